"""Writes a Llama checkpoint that no one trained: its next token follows from the last one alone.

Any server that loads Llama weights answers with it, the same way every time: a person's message
with a tool call, a tool's result with a sentence. Usage: checkpoint.py DIRECTORY
"""

import json
import sys
from itertools import pairwise
from pathlib import Path
from struct import pack
from typing import Any

PLAN: dict[str, Any] = {
    "contract": {"groups": [{"relation": "around", "targets": ["t1"], "robots": 6}]},
    "targets": [{"id": "t1", "box": [55, 35, 125, 95]}],
}
CALL = json.dumps({"name": "propose_formation", "arguments": PLAN})
SENTENCE = "Six robots have a place."
PIECE = 10
"""Characters of a token at most: some servers lose tokens of more than 32 bytes."""
CONTEXT = 32_768
"""Tokens; formup's prompt and tools take some thousand words."""
ANY, START, END, TO_CALL, TO_SAY = "<|any|>", "<|im_start|>", "<|im_end|>", "<|call|>", "<|say|>"
CONTROL = (ANY, START, END, TO_CALL, TO_SAY)
"""ANY stands for every word that is not in the script; nothing depends on them."""

# The server takes the generated tokens for a call by these tags, as it does for many models.
OPEN, CLOSE = "<tool_call>", "</tool_call>"
PARTS = {
    "defaults": {"role": "assistant"},
    "start_anchor_pattern": r"<\|im_start\|>(?:<\|call\|>|<\|say\|>)",
    "fields": {
        "tool_calls": {
            "open_pattern": r"\s*" + OPEN,
            "close": CLOSE,
            "repeats": True,
            "content": "json",
            "transform": {"type": "function", "function": "{content}"},
        },
        "content": {"close_pattern": r"\s*<\|im_end\|>", "content": "text"},
    },
}
TEMPLATE = """\
{% for tool in tools or [] %}{{ tool | tojson }}
{% endfor %}{% for message in messages %}<|im_start|>{{ message.role }}
{{ message.content }}
{% for call in message.tool_calls or [] %}{{ call.function | tojson }}
{% endfor %}<|im_end|>
{% endfor %}{% if add_generation_prompt %}<|im_start|>\
{% if tools and messages[-1].role != 'tool' %}<|call|>{% else %}<|say|>{% endif %}{% endif %}"""


def cut(text: str) -> list[str]:
    """A text in pieces that are tokens."""
    return [text[at : at + PIECE] for at in range(0, len(text), PIECE)]


def script() -> list[list[str]]:
    """What follows TO_CALL, and what follows TO_SAY."""
    return [[TO_CALL, OPEN, *cut(CALL), CLOSE, END], [TO_SAY, *cut(SENTENCE), END]]


def vocabulary() -> list[str]:
    """Every token; its index is its id.

    Raises:
        ValueError: a piece occurs twice, so that what follows it is not known.
    """
    pieces = [piece for line in script() for piece in line if piece not in CONTROL]
    if len(set(pieces)) < len(pieces):
        raise ValueError(f"A piece occurs twice; choose another length than {PIECE}.")
    return [*CONTROL, *pieces]


def tokenizer(tokens: list[str]) -> dict[str, Any]:
    """Splits at white space, keeps the script's pieces whole, and takes the rest for ANY."""
    flags = {"single_word": False, "lstrip": False, "rstrip": False, "normalized": False}
    return {
        "version": "1.0",
        "added_tokens": [
            {"id": id, "content": token, "special": token in CONTROL} | flags
            for id, token in enumerate(tokens)
        ],
        "normalizer": None,
        "pre_tokenizer": {"type": "WhitespaceSplit"},
        "post_processor": None,
        "decoder": {"type": "Fuse"},
        "model": {"type": "WordLevel", "vocab": {ANY: 0}, "unk_token": ANY},
    }


def config(size: int) -> dict[str, Any]:
    """One layer, as wide as there are tokens."""
    return {
        "architectures": ["LlamaForCausalLM"],
        "model_type": "llama",
        "dtype": "float32",
        "vocab_size": size,
        "hidden_size": size,
        "intermediate_size": 1,
        "num_hidden_layers": 1,
        "num_attention_heads": 1,
        "num_key_value_heads": 1,
        "head_dim": size,
        "hidden_act": "silu",
        "rms_norm_eps": 1e-6,
        "max_position_embeddings": CONTEXT,
        "tie_word_embeddings": False,
        "bos_token_id": 0,
        "pad_token_id": 0,
        "eos_token_id": CONTROL.index(END),
    }


def weights(tokens: list[str], size: int) -> dict[str, list[list[float]]]:
    """Each token is a direction, the layer adds nothing, and the head maps it to its successor."""

    def square() -> list[list[float]]:
        return [[0.0] * size for _ in range(size)]

    embedding, head = square(), square()
    for id in range(size):
        embedding[id][id] = 1.0
        head[CONTROL.index(END)][id] = 0.5  # whatever is not in the script ends it
    for line in script():
        for before, after in pairwise(line):
            head[tokens.index(after)][tokens.index(before)] = 8.0
    layer = "model.layers.0."
    zeros = {f"{layer}self_attn.{part}_proj.weight": square() for part in "qkvo"}
    return zeros | {
        "model.embed_tokens.weight": embedding,
        "lm_head.weight": head,
        f"{layer}mlp.gate_proj.weight": [[0.0] * size],
        f"{layer}mlp.up_proj.weight": [[0.0] * size],
        f"{layer}mlp.down_proj.weight": [[0.0]] * size,
        f"{layer}input_layernorm.weight": [[1.0] * size],
        f"{layer}post_attention_layernorm.weight": [[1.0] * size],
        "model.norm.weight": [[1.0] * size],
    }


def safetensors(tensors: dict[str, list[list[float]]]) -> bytes:
    """A file of matrices in single precision: length of the header, header, data."""
    header: dict[str, Any] = {"__metadata__": {"format": "pt"}}
    data = b""
    for name, rows in tensors.items():
        flat = [value for row in rows for value in row]
        shape = [len(rows), len(rows[0])] if "norm" not in name else [len(flat)]
        offsets = [len(data), len(data) + 4 * len(flat)]
        header[name] = {"dtype": "F32", "shape": shape, "data_offsets": offsets}
        data += pack(f"<{len(flat)}f", *flat)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    return pack("<Q", len(text)) + text + data


def main(folder: Path) -> None:
    """Write all files of the checkpoint."""
    tokens = vocabulary()
    size = len(tokens) + len(tokens) % 2  # positions rotate pairs of dimensions
    described = {
        "tokenizer_class": "PreTrainedTokenizerFast",
        "model_max_length": CONTEXT,
        "bos_token": ANY,
        "pad_token": ANY,
        "unk_token": ANY,
        "eos_token": END,
        "response_template": PARTS,
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, value in (
        ("config.json", config(size)),
        ("generation_config.json", {"eos_token_id": CONTROL.index(END), "pad_token_id": 0}),
        ("tokenizer.json", tokenizer(tokens)),
        ("tokenizer_config.json", described),
    ):
        (folder / name).write_text(json.dumps(value, indent=1), encoding="utf-8")
    (folder / "chat_template.jinja").write_text(TEMPLATE, encoding="utf-8")
    (folder / "model.safetensors").write_bytes(safetensors(weights(tokens, size)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
