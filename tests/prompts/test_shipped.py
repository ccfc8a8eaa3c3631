"""The prompts that ship, whichever they are: what was released is what it was, and clean."""

import pytest
from formup.prompts import PromptLibrary, load_prompt
from formup.prompts.library import SHIPPED
from formup.prompts.lint import lint
from formup.prompts.lock import read_lock

TEXTS = {
    "context@v001": "02ee07c73369f92a37a77c219eb450e0c54c58c14975d33e606be2eb1dacf778",
    "former-direct@v001": "0923adb3e659d95c257fc634ad5ab1b3e83b49487194bbfd30a67724f0364fc0",
    "former@v001": "f2e680be74340ae73098cd3c674343b1d27950e82ffdee677637107f2ec996a3",
    "former@v002": "9f9857f2511f867ee2bd562ef2742abb62407deb91ecc67d88ff767a101f5fae",
    "repair@v001": "edf18cbedc3b1394ae98c14ba2e079b26431762ab338b94dc12162f126b3960c",
}
"""What the first recorded runs name: LOCK.json cannot be written anew over them."""


@pytest.mark.parametrize("name", TEXTS)
def test_shipped_texts_are_what_recorded_runs_were_told(name: str) -> None:
    assert load_prompt(name).sha256 == TEXTS[name]


def test_everything_shipped_is_locked_and_as_it_was_released() -> None:
    lock = read_lock(SHIPPED)
    prompts = [load_prompt(name) for name in PromptLibrary().names()]
    hashes = {p.name: (p.sha256, p.file_sha256) for p in prompts}
    assert hashes == {name: (was.sha256, was.file_sha256) for name, was in lock.items()}
    assert TEXTS.items() <= {name: sha256 for name, (sha256, _) in hashes.items()}.items()


def test_every_id_has_a_current_version_that_asks_for_no_values() -> None:
    ids = PromptLibrary().ids()
    assert {"context", "former", "former-direct", "planner", "repair"} <= set(ids)
    for id in ids:
        assert load_prompt(id).render()


def test_the_shipped_prompts_are_clean() -> None:
    assert lint(PromptLibrary()) == []
