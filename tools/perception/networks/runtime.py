"""The only module that uses torch and transformers, which are untyped; all others see arrays.

Device and precision depend on the machine: see `settings`.
"""

import hashlib
import json
import logging
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .checkpoints import checkpoint_folder
from .settings import DEVICE, device_name, dtype_name

Floats = NDArray[np.float32]
MISSING = 0.05
"""Greatest share of a network's weights that a checkpoint may lack: names change over releases."""
NAMED = 5
"""The most missing weights that are named."""
LOG = logging.getLogger(__name__)
REMEMBERED = 4
"""Number of pictures whose embeddings are cached: each takes a few MB, on a GPU of its memory."""


@dataclass
class Network:
    """A network with its weights, ready to run.

    Attributes:
        model, processor: objects of transformers; the processor is None if none is used.
        device, dtype: where and with what precision it computes.
        memory: cached embeddings of the last pictures, by hash of their content.
    """

    model: Any
    processor: Any
    device: str
    dtype: Any
    memory: OrderedDict[str, Any] = field(default_factory=OrderedDict[str, Any])
    _turn: threading.Lock = field(default_factory=threading.Lock)

    def run(self, method: Callable[..., Any], inputs: Mapping[str, Any]) -> Any:
        """Call a method of the model on arrays or tensors, without gradients.

        Raises:
            InputError: the network does not fit in the device's memory.
        """
        torch = _torch()
        with self._turn, torch.inference_mode():
            try:
                return method(**{name: self._to_device(value) for name, value in inputs.items()})
            except torch.OutOfMemoryError:
                raise InputError(
                    f"The network does not fit in the memory of {self.device}: set "
                    "FORMUP_DEVICE=cpu or FORMUP_DTYPE=float16, or name a smaller checkpoint."
                ) from None

    def remembered(self, pixels: NDArray[np.uint8], make: Callable[[], Any]) -> Any:
        """Return what is cached for a picture's content, making it first if it is not cached."""
        key = hashlib.sha256(pixels.tobytes()).hexdigest() + str(pixels.shape)
        if key not in self.memory:
            self.memory[key] = make()
            for old in [*self.memory][:-REMEMBERED]:
                self.memory.pop(old, None)
        return self.memory[key]

    def _to_device(self, value: Any) -> Any:
        torch = _torch()
        value = torch.from_numpy(value) if isinstance(value, np.ndarray) else value
        if not isinstance(value, torch.Tensor):
            return value
        # Processors give float64, which not every device has.
        return value.to(self.device, self.dtype if value.is_floating_point() else value.dtype)


def load_network(name: str, classes: Mapping[str, str], *, processor: bool) -> Network:
    """Load a network from its checkpoint.

    Args:
        name: name of the checkpoint, see `checkpoint_folder`.
        classes: names of transformers' classes by the kind of model (`model_type`) they load.
        processor: whether to load its processor, which turns words and pictures into its inputs.

    Raises:
        InputError: torch or the checkpoint is missing, or the checkpoint is broken or of another
            kind.
    """
    needs_torch()
    device, dtype = _device(), getattr(_torch(), dtype_name())
    folder = checkpoint_folder(name)
    made = classes.get(_kind(folder))
    if made is None:
        kinds = " or ".join(classes)
        raise InputError(
            f"The checkpoint {name} holds a network of the kind {_kind(folder)!r}, not {kinds}."
        )
    transformers: Any = import_module("transformers")
    import_module("transformers.utils.logging").disable_progress_bar()  # the files are local
    options = {"local_files_only": True, "use_safetensors": True, "dtype": dtype}
    try:
        model, report = getattr(transformers, made).from_pretrained(
            folder, output_loading_info=True, **options
        )
        words = transformers.AutoProcessor.from_pretrained(folder) if processor else None
        model = model.to(device).eval()
    except Exception as error:  # a broken file fails in many ways, all for the person to mend
        why = (str(error).strip() or type(error).__name__).splitlines()[0].rstrip(".")
        raise InputError(f"The checkpoint {name} cannot be loaded: {why}.") from None
    if len(report["missing_keys"]) > MISSING * len(model.state_dict()):
        raise InputError(f"The checkpoint {name} lacks weights of its network; fetch it again.")
    if report["missing_keys"]:
        lacking = ", ".join(sorted(report["missing_keys"])[:NAMED])
        LOG.warning("The checkpoint %s lacks weights, which are random: %s.", name, lacking)
    return Network(model, words, device, dtype)


def needs_torch() -> None:
    """Check that networks can be run.

    Raises:
        InputError: the extra is not installed.
    """
    if not (find_spec("torch") and find_spec("transformers")):
        raise InputError("Trained networks need the extra: pip install 'formup[torch]'.")


def resized(values: Any, size: tuple[int, int]) -> Any:
    """Resize pictures (..., h, w), an array or tensor, to a height and width; return a tensor."""
    torch = _torch()
    values = torch.from_numpy(values) if isinstance(values, np.ndarray) else values
    flat = values.reshape(1, -1, *values.shape[-2:]).float()
    resize = torch.nn.functional.interpolate
    smaller = size[0] < values.shape[-2] or size[1] < values.shape[-1]
    made = resize(flat, size=size, mode="bilinear", align_corners=False, antialias=smaller)
    return made.reshape(*values.shape[:-2], *size)


def array(values: Any) -> Floats:
    """Convert a tensor to an array."""
    return np.asarray(values.detach().float().cpu().numpy(), dtype=np.float32)


def _torch() -> Any:
    return import_module("torch")


def _kind(folder: Path) -> str:
    try:
        return str(json.loads((folder / "config.json").read_text("utf-8"))["model_type"])
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(f"{folder / 'config.json'} names no kind of network.") from None


def _device() -> str:
    """Return the device that is set, else a GPU if there is one, else the CPU.

    Raises:
        InputError: the device that is set cannot be used.
    """
    torch = _torch()
    chosen = device_name("cuda" if torch.cuda.is_available() else "cpu")
    try:
        torch.empty(1, device=chosen)
    except (RuntimeError, AssertionError, NotImplementedError):
        raise InputError(
            f"{DEVICE}={chosen!r} cannot be used here; cpu can, and cuda, cuda:1 or mps where "
            "torch finds them."
        ) from None
    return chosen
