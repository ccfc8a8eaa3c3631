"""Writes tiny checkpoints, as transformers saves any: what loads and runs them is the real thing.

Weights are random, but for two that are set by hand to see red, so that masks can be looked at.
Usage: checkpoints.py FOLDER
"""

import string
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

torch: Any = import_module("torch")
t: Any = import_module("transformers")
SIDE = 64


def clipseg(folder: Path) -> None:
    """CLIPSeg at 64 px, in patches of 8, with weights set by hand: whatever is asked is red."""
    tokenizer = _clip_tokenizer()
    text = {
        "vocab_size": len(tokenizer),
        "bos_token_id": tokenizer.bos_token_id,
        "eos_token_id": tokenizer.eos_token_id,
        "pad_token_id": tokenizer.pad_token_id,
        "max_position_embeddings": 32,
    }
    config = t.CLIPSegConfig(
        text_config=text | _SMALL,
        vision_config={"image_size": SIDE, "patch_size": 8} | _SMALL,
        projection_dim=32,
        extract_layers=[0, 1],
        reduce_dim=16,
        decoder_num_attention_heads=2,
        decoder_intermediate_size=32,
    )
    size = {"height": SIDE, "width": SIDE}
    images = t.ViTImageProcessor(size=size)
    model = t.CLIPSegForImageSegmentation(config)
    _made_to_see_red(model)
    _save(folder, model, t.CLIPSegProcessor(images, tokenizer))


def _made_to_see_red(model: Any) -> None:
    """Patches carry their redness beside a constant through all layers, which add nothing."""
    _blank(model)
    with torch.no_grad():
        vision, decoder = model.clip.vision_model.embeddings, model.decoder
        vision.patch_embedding.weight[0] = _redness(vision.patch_embedding)
        vision.position_embedding.weight[:, 1] = 1.0
        for reduce in decoder.reduces:
            reduce.weight[0, 0] = reduce.weight[1, 1] = 1.0
        decoder.film_mul.bias.fill_(1.0)
        decoder.transposed_convolution.weight[0] = 1.0
        decoder.transposed_convolution.weight[1] = -1.0


def grounding_dino(folder: Path, kind: str = "GroundingDino") -> None:
    """Grounding DINO with 8 queries, or MMGroundingDino."""
    torch.manual_seed(0)
    letters = string.ascii_lowercase
    words = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]", ".", *letters]
    vocabulary = {w: i for i, w in enumerate([*words, *(f"##{x}" for x in letters)])}
    tokenizer = t.BertTokenizer(vocab=vocabulary)
    backbone = t.SwinConfig(
        image_size=SIDE,
        embed_dim=16,
        depths=[1, 1, 1, 1],
        num_heads=[2, 2, 2, 2],
        window_size=4,
        out_features=["stage2", "stage3", "stage4"],
    )
    text = t.BertConfig(vocab_size=len(vocabulary), max_position_embeddings=64, **_SMALL)
    config = getattr(t, f"{kind}Config")(
        backbone_config=backbone,
        text_config=text,
        num_queries=8,
        d_model=32,
        encoder_layers=1,
        decoder_layers=2,
        encoder_ffn_dim=32,
        decoder_ffn_dim=32,
        encoder_attention_heads=2,
        decoder_attention_heads=2,
        num_feature_levels=3,
        disable_custom_kernels=True,
        max_text_len=64,
    )
    model = getattr(t, f"{kind}ForObjectDetection")(config)
    images = t.GroundingDinoImageProcessor(size={"shortest_edge": SIDE, "longest_edge": SIDE})
    _save(folder, model, t.GroundingDinoProcessor(images, tokenizer))


def sam(folder: Path) -> None:
    """SAM at 128 px."""
    torch.manual_seed(0)
    config = t.SamConfig(
        vision_config={
            "hidden_size": 32,
            "num_hidden_layers": 2,
            "num_attention_heads": 2,
            "image_size": 128,
            "patch_size": 16,
            "output_channels": 16,
            "mlp_dim": 32,
            "window_size": 4,
            "global_attn_indexes": [1],
            "num_pos_feats": 8,
        },
        prompt_encoder_config={"hidden_size": 16, "image_size": 128, "mask_input_channels": 4},
        mask_decoder_config={
            "hidden_size": 16,
            "mlp_dim": 16,
            "num_hidden_layers": 1,
            "num_attention_heads": 2,
            "iou_head_hidden_dim": 16,
        },
    )
    model = t.SamModel(config)
    _made_to_mask_red(model)
    _save(folder, model)


def _made_to_mask_red(model: Any) -> None:
    """Three like masks of what is red, each worth 0.9, wherever is pointed."""
    _blank(model)
    with torch.no_grad():
        vision, decoder = model.vision_encoder, model.mask_decoder
        vision.patch_embed.projection.weight[0] = _redness(vision.patch_embed.projection)
        vision.patch_embed.projection.bias[1] = 1.0
        for channel in (0, 1):
            vision.neck.conv1.weight[channel, channel] = 1.0
            vision.neck.conv2.weight[channel, channel, 1, 1] = 1.0
            decoder.upscale_conv1.weight[channel, channel] = 1.0
            decoder.upscale_conv2.weight[channel, channel] = 1.0
            decoder.upscale_conv2.weight[channel, 1 - channel] = -1.0
        for network in decoder.output_hypernetworks_mlps:
            network.proj_out.bias[:2] = torch.tensor([1.0, -1.0])
        decoder.iou_prediction_head.proj_out.bias.fill_(0.9)


def sam2(folder: Path) -> None:
    """SAM 2 at 128 px."""
    torch.manual_seed(0)
    backbone = t.Sam2HieraDetConfig(
        hidden_size=16,
        num_attention_heads=1,
        image_size=[128, 128],
        blocks_per_stage=[1, 2, 2, 1],
        embed_dim_per_stage=[16, 32, 64, 128],
        num_attention_heads_per_stage=[1, 2, 2, 4],
        window_size_per_stage=[4, 4, 4, 4],
        window_positional_embedding_background_size=[4, 4],
        global_attention_blocks=[4],
    )
    vision = t.Sam2VisionConfig(
        backbone_config=backbone,
        backbone_channel_list=[128, 64, 32, 16],
        backbone_feature_sizes=[[32, 32], [16, 16], [8, 8]],
        fpn_hidden_size=32,
    )
    config = t.Sam2Config(
        vision_config=vision,
        prompt_encoder_config={"hidden_size": 32, "image_size": 128, "patch_size": 16},
        mask_decoder_config={"hidden_size": 32, "mlp_dim": 32, "iou_head_hidden_dim": 32},
    )
    _save(folder, t.Sam2Model(config))


def _blank(model: Any) -> None:
    """All weights 0, but for norms: what comes in goes through."""
    with torch.no_grad():
        for name, weight in model.named_parameters():
            weight.fill_(1.0 if "norm" in name and name.endswith("weight") else 0.0)


def _redness(patches: Any) -> Any:
    """Weights of a patch embedding (3, h, w) that answer to red."""
    red = torch.tensor([1.0, -0.5, -0.5])[:, None, None]
    return 10 * red / patches.weight[0, 0].numel()


_SMALL = {
    "hidden_size": 32,
    "intermediate_size": 32,
    "num_hidden_layers": 2,
    "num_attention_heads": 2,
}


def _clip_tokenizer() -> Any:
    printable = [chr(c) for c in range(33, 127)]
    words = [*printable, *(f"{c}</w>" for c in printable), "<|startoftext|>", "<|endoftext|>"]
    return t.CLIPTokenizer(vocab={w: i for i, w in enumerate(words)}, merges=[])


def _save(folder: Path, model: Any, processor: Any = None) -> None:
    model.save_pretrained(folder)
    if processor is not None:
        processor.save_pretrained(folder)


if __name__ == "__main__":
    to = Path(sys.argv[1])
    clipseg(to / "clipseg")
    grounding_dino(to / "groundingdino")
    grounding_dino(to / "mm-groundingdino", "MMGroundingDino")
    sam(to / "sam")
    sam2(to / "sam2.1")
