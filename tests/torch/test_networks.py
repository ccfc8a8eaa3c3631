"""Each backend's real loading and inference, on tiny checkpoints."""

import shutil
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.tools.builtin.seeing import locate_object, segment
from formup.tools.context import Context, Services, Settings
from formup.tools.errors import InputError, ToolError
from formup.tools.perception.detection import Finder
from formup.tools.perception.detectors.registry import detector_named
from formup.tools.perception.image import Picture
from formup.tools.perception.networks.checkpoints import checkpoint_folder
from formup.tools.perception.referring.query import Query
from formup.tools.perception.segmenters.registry import segmenter_named
from formup.tools.perception.target_prompt import TargetPrompt
from formup.tools.tool import ToolResult

BOXES = [[[80.0, 60.0, 159.0, 119.0]]]
BOX = TargetPrompt(box=(80, 60, 159, 119))
OUTLINE = TargetPrompt(outline=((80, 60), (159, 60), (159, 119), (80, 119)))
POINTS = TargetPrompt(points=((100, 90), (120, 80)), negative=((10, 10),))


def context_of(picture: Picture, checkpoints: Path, **names: str) -> Context:
    """With a detector or segmenter on its checkpoint."""
    chosen = {kind: f"{name}:{checkpoints / name}" for kind, name in names.items()}
    return Context.of(picture, Settings.model_validate(chosen), services=Services(found={}))


def located(context: Context, **query: Any) -> ToolResult:
    made = locate_object.function(context, query=Query.model_validate(query))
    assert isinstance(made, ToolResult)
    return made


def segmented(context: Context, text: str) -> ToolResult:
    made = segment.function(context, text=text)
    assert isinstance(made, ToolResult)
    return made


def sam_of_transformers(folder: Path, pixels: Any) -> tuple[Any, Any]:
    """Logits and scores of the box as transformers' own processor has them."""
    torch, t = import_module("torch"), import_module("transformers")
    model, processor = (
        t.SamModel.from_pretrained(folder),
        t.SamProcessor(
            t.SamImageProcessorPil(
                size={"longest_edge": 128},
                pad_size={"height": 128, "width": 128},
                mask_size={"longest_edge": 32},
                mask_pad_size={"height": 32, "width": 32},
            )
        ),
    )
    inputs = processor(images=pixels, input_boxes=BOXES, return_tensors="pt")
    inputs["input_boxes"] = inputs["input_boxes"].float()
    with torch.inference_mode():
        made = model(**inputs, multimask_output=True)
    masks = processor.post_process_masks(
        made.pred_masks, inputs["original_sizes"], inputs["reshaped_input_sizes"], binarize=False
    )
    return masks[0][0].numpy(), made.iou_scores[0, 0].numpy()


def test_sam_sees_what_transformers_own_processor_shows_it(
    checkpoints: Path, one_red: Picture
) -> None:
    folder = checkpoints / "sam"
    logits, scores = sam_of_transformers(folder, one_red.pixels)
    found = segmenter_named(f"sam:{folder}").segment(one_red.pixels, BOX)
    best = int(scores.argmax())
    assert found.parts["predicted_iou"] == pytest.approx(float(scores[best]), abs=1e-4)
    theirs = logits[best] > 0
    assert np.count_nonzero(found.mask & theirs) > 0.97 * np.count_nonzero(found.mask | theirs)


@pytest.mark.parametrize("name", ["sam", "sam2.1"])
@pytest.mark.parametrize("prompt", [BOX, OUTLINE, POINTS], ids=["box", "outline", "points"])
def test_alpha_of_sam_names_its_parts(
    checkpoints: Path, one_red: Picture, name: str, prompt: TargetPrompt
) -> None:
    found = segmenter_named(f"{name}:{checkpoints / name}").segment(one_red.pixels, prompt)
    parts = {"predicted_iou", "stability", "prompt_fit", "colour_separation"}
    left = {"prompt_fit"} if prompt is POINTS else set[str]()
    if not found.mask.any():  # what covers nearly the whole picture is no thing
        assert found.confidence == 0
        return
    assert set(found.parts) == parts - left
    mean = float(np.prod(list(found.parts.values())) ** (1 / len(found.parts)))
    assert found.confidence == pytest.approx(mean)
    assert found.mask.shape == one_red.pixels.shape[:2]


def test_a_picture_goes_through_the_large_part_of_sam_once(
    checkpoints: Path, one_red: Picture, two_red: Picture, monkeypatch: pytest.MonkeyPatch
) -> None:
    sam: Any = segmenter_named(f"sam2.1:{checkpoints / 'sam2.1'}")
    network = sam.network
    network.memory.clear()
    seen: list[object] = []
    embed = network.model.get_image_embeddings

    def embedding(**inputs: Any) -> Any:
        seen.append(inputs)
        return embed(**inputs)

    monkeypatch.setattr(network.model, "get_image_embeddings", embedding)
    for picture in (one_red, one_red, two_red, one_red):
        sam.segment(picture.pixels, BOX)
    assert len(seen) == 2
    for shade in range(9):
        sam.segment(np.full((20, 20, 3), shade, np.uint8), TargetPrompt(points=((9, 9),)))
    assert len(network.memory) == 4


@pytest.mark.parametrize("name", ["groundingdino", "mm-groundingdino"])
def test_boxes_lie_in_the_picture_and_come_with_scores(
    checkpoints: Path, one_red: Picture, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORMUP_DETECTION_THRESHOLD", "0")
    detector_named.cache_clear()
    detector = detector_named(f"{name}:{checkpoints / name}")
    assert isinstance(detector, Finder)
    assert detector.detect(one_red) == ()
    found = detector.find(one_red.pixels, "red car")
    assert found
    assert [d.score for d in found] == sorted((d.score for d in found), reverse=True)
    for d in found:
        x0, y0, x1, y1 = d.box
        assert 0 <= x0 < x1 <= one_red.width - 1
        assert 0 <= y0 < y1 <= one_red.height - 1
        assert d.mask is None
    monkeypatch.setenv("FORMUP_DETECTION_THRESHOLD", "0.9999")
    detector_named.cache_clear()
    none = detector_named(f"{name}:{checkpoints / name}")
    assert isinstance(none, Finder)
    assert none.find(one_red.pixels, "red car") == ()


def test_all_that_is_found_by_a_noun_comes_back_and_the_rest_is_code(
    checkpoints: Path, two_red: Picture
) -> None:
    context = context_of(two_red, checkpoints, segmenter="clipseg")
    before = [c.id for c in context.candidates()]
    reply = located(context, noun="The  Fork")
    assert not reply.data["settled"]
    assert len(reply.data["candidates"]) == 2
    for found in reply.data["candidates"]:
        (naming,) = found["named"]
        assert naming["noun"] == "fork"
        assert 0 < naming["mask"] <= 1 and naming["score"] > 0.9
    right = located(context, noun="fork", picks=[{"by": "rightmost"}])
    assert right.data["settled"]
    assert right.world is not None
    assert right.world.phrases == ("fork",)
    # Two masks that overlap are of one thing, whichever way it was found.
    after = [c.id for c in context.at(right.world).candidates()]
    assert after[: len(before)] == before
    assert len(after) <= len(before) + 1


def test_a_blank_picture_holds_nothing_and_false_finds_are_none(
    checkpoints: Path, blank: Picture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORMUP_DETECTION_THRESHOLD", "0")
    for cached in (detector_named, segmenter_named):
        cached.cache_clear()
    for names in ({"segmenter": "clipseg"}, {"detector": "groundingdino"}):
        context = context_of(blank, checkpoints, **names).looking_for(["fork"])
        assert context.candidates() == ()
    for cached in (detector_named, segmenter_named):
        cached.cache_clear()


def test_text_points_at_exactly_one_thing_or_says_which_there_are(
    checkpoints: Path, one_red: Picture, two_red: Picture
) -> None:
    context = context_of(one_red, checkpoints, segmenter="clipseg")
    reply = segmented(context, "fork")
    assert reply.data["label"] == "fork"
    assert {"probability", "stability", "colour_separation", "detector_score"} == set(
        reply.data["parts"]
    )
    with pytest.raises(ToolError, match=r'2 things were found as "fork": c1, c\d\. Name one'):
        segmented(context_of(two_red, checkpoints, segmenter="clipseg"), "fork")


def test_boxes_by_words_are_measured_by_any_segmenter_that_takes_boxes(
    checkpoints: Path, one_red: Picture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORMUP_DETECTION_THRESHOLD", "0")
    detector_named.cache_clear()
    context = context_of(one_red, checkpoints, detector="groundingdino", segmenter="sam")
    named = context.looking_for(["fork"]).candidates()
    assert named
    assert all("predicted_iou" in c.named[0].parts for c in named)
    beside = f"standout+groundingdino:{checkpoints / 'groundingdino'}"
    both = Context.of(one_red, Settings(detector=beside), services=Services(found={}))
    (measured,) = both.candidates()
    assert both.looking_for(["fork"]).candidates()[0].outline == measured.outline
    detector_named.cache_clear()
    with pytest.raises(InputError, match="gives boxes, which the segmenter 'clipseg' does not"):
        context_of(one_red, checkpoints, detector="groundingdino", segmenter="clipseg")


def test_the_first_use_says_what_is_downloaded(
    checkpoints: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    hub = import_module("huggingface_hub")
    kept, source = tmp_path / "kept", checkpoints / "sam"
    files = [type("File", (), {"file_size": 5_000_000, "will_download": True})] * 2

    def snapshot(name: str, local_files_only: bool = False, **given: Any) -> Any:
        if given.get("dry_run"):
            return files
        if local_files_only and not kept.exists():
            raise hub.errors.LocalEntryNotFoundError("not here")
        return kept if kept.exists() else shutil.copytree(source, kept)

    def about(*given: Any, **more: Any) -> Any:
        return type("Info", (), {"card_data": type("Card", (), {"license": "apache-2.0"})})

    monkeypatch.setattr(hub, "snapshot_download", snapshot)
    monkeypatch.setattr(hub.HfApi, "model_info", about)
    assert checkpoint_folder("facebook/sam-vit-base@main") == kept
    assert "Downloading facebook/sam-vit-base once: 10 MB from " in (err := capsys.readouterr().err)
    assert "licence: apache-2.0" in err
    assert checkpoint_folder("facebook/sam-vit-base@main") == kept
    assert capsys.readouterr().err == ""


def test_weights_that_a_checkpoint_lacks_are_named(
    checkpoints: Path,
    two_red: Picture,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:
    safetensors = import_module("safetensors.torch")
    folder = tmp_path / "sam"
    shutil.copytree(checkpoints / "sam", folder)
    weights = safetensors.load_file(folder / "model.safetensors")
    lost = sorted(weights)[0]
    safetensors.save_file(
        {name: value for name, value in weights.items() if name != lost},
        folder / "model.safetensors",
        metadata={"format": "pt"},
    )
    segmenter_named(f"sam:{folder}").segment(two_red.pixels, BOX)
    assert f"lacks weights, which are random: {lost}" in caplog.text
