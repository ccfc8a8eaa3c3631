"""What a page keeps and where it leads: drafts, forks, other pictures, paths before a motion."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from playwright.sync_api import Dialog, expect

PHOTOS = Path(__file__).parents[4] / "evals/photos/images"
LONG = 20_000


def test_what_was_not_sent_is_there_after_a_reload(server: Any, visit: Any) -> None:
    here = visit(server.url)
    here.begin()
    here.page.locator("[data-tool=point]").press("Enter")
    here.page.locator(".thing").first.wait_for(state="attached", timeout=LONG)
    here.page.locator('.thing[data-id="c2"]').press("Enter")
    expect(here.page.locator("#pointed .chip")).to_have_count(1, timeout=LONG)
    here.page.fill("#words", "surround it with 6")
    here.page.reload()
    expect(here.page.locator("#pointed .chip")).to_have_count(1, timeout=LONG)
    expect(here.page.locator("#words")).to_have_value("surround it with 6")
    here.page.keyboard.press("Enter")
    expect(here.page.locator("#log > li[data-status]")).to_have_count(1, timeout=LONG)
    target = server.client.get(here.session).json()["last"]["targets"][0]
    assert target["found_from"] == "candidate"
    here.rest()
    here.page.reload()
    expect(here.page.locator(".robot").first).to_be_attached(timeout=LONG)
    expect(here.page.locator("#words")).to_have_value("")
    expect(here.page.locator("#pointed .chip")).to_have_count(0)


def test_an_earlier_plan_is_gone_back_to_and_gone_on_from(server: Any, visit: Any) -> None:
    here = visit(server.url)
    here.begin()
    here.say("Surround the coin")
    here.say("c1")
    first = server.client.get(here.session).json()["current"]
    here.say("take two away")
    here.say("a bit further out")
    here.page.click("#strip button >> nth=0")
    expect(here.page.locator("#sliders")).to_contain_text("This is an earlier plan", timeout=LONG)
    expect(here.page.locator(".robot")).to_have_count(8)
    expect(here.page.locator("#go")).to_be_disabled()
    before = here.session
    here.page.get_by_role("button", name="Go on from it in a session of its own").click()
    here.page.wait_for_function("id => !location.hash.endsWith(id)", arg=before.rpartition("/")[2])
    expect(here.page.locator(".robot")).to_have_count(8, timeout=LONG)
    assert server.client.get(here.session).json()["plans"] == [first]
    here.page.go_back()
    expect(here.page.locator(".robot")).to_have_count(6, timeout=LONG)
    here.page.click("#strip button >> nth=0")
    here.page.get_by_role("button", name="Go back to it").click()
    expect(here.page.locator("#log > li").last).to_contain_text("Back to an earlier plan")
    here.rest()
    assert server.client.get(here.session).json()["current"] == first


def test_another_picture_is_dropped_on_a_session(server: Any, visit: Any) -> None:
    here = visit(server.url)
    here.begin()
    here.say("Surround the largest coin")
    data = (PHOTOS / "cars_two.jpg").read_bytes()
    here.page.evaluate(
        """async (bytes) => {
          const file = new File([new Uint8Array(bytes)], 'cars.jpg', { type: 'image/jpeg' });
          const transfer = new DataTransfer();
          transfer.items.add(file);
          window.dispatchEvent(new DragEvent('drop', { dataTransfer: transfer }));
        }""",
        list(data),
    )
    expect(here.page.locator("#log > li").last).to_contain_text("cars.jpg", timeout=LONG)
    here.rest()
    scene = server.client.get(f"{here.session}/scene").json()
    assert (scene["picture"]["width"], scene["picture"]["height"]) == (768, 432)
    assert scene["plan"]["void"]
    expect(here.page.locator("#certificate .badge")).to_have_text("void")
    expect(here.page.locator("#go")).to_be_disabled()


def test_the_ways_are_shown_before_anything_moves(server: Any, visit: Any) -> None:
    here = visit(server.url)
    here.begin()
    here.say("Surround the largest coin")
    here.page.click("#go")
    expect(here.page.locator("#scene .path")).to_have_count(8, timeout=LONG)
    here.page.keyboard.press("Escape")
    expect(here.page.locator("#approval")).to_be_hidden()
    assert server.client.get(here.session).json()["last"]["status"] == "planned"
    scene = server.client.get(f"{here.session}/scene").json()
    plan = scene["plan"]
    paths = server.client.get(f"{here.session}/plans/{plan['id']}/paths").json()
    stood = {robot["id"]: [robot["x"], robot["y"]] for robot in scene["robots"]}
    places = {robot["id"]: [robot["x"], robot["y"]] for robot in plan["robots"]}
    for robot, path in paths.items():
        for seen, wanted in ((path[0], stood[robot]), (path[-1], places[robot])):
            assert abs(seen[0] - wanted[0]) < 0.2 and abs(seen[1] - wanted[1]) < 0.2


def test_robots_are_kept_off_what_is_pointed_at_for_that(server: Any, visit: Any) -> None:
    here = visit(server.url)
    here.begin()
    here.page.click("[data-tool=point]")
    for thing in ("c1", "c4"):
        here.page.locator(f'.thing[data-id="{thing}"]').press("Enter", timeout=LONG)
        expect(here.page.locator("#pointed .chip")).to_have_count(
            1 if thing == "c1" else 2, timeout=LONG
        )
    here.page.get_by_label("keep off").nth(1).check()
    here.say("Surround it, 40 px from it")
    scene = server.client.get(f"{here.session}/scene").json()
    assert len(scene["targets"]) == len(scene["keep_out"]) == 1
    expect(here.page.locator("#scene path.off")).to_have_count(1)
    expect(here.page.locator("#pointed .chip")).to_have_count(0)


def test_a_session_that_is_not_there_leads_to_the_start(server: Any, visit: Any) -> None:
    here = visit(server.url)
    here.begin()
    here.say("Surround the largest coin")
    session = here.session
    here.page.evaluate("location.hash = 'nosuchsession'")
    expect(here.page.locator("#start-problem")).to_contain_text("not here", timeout=LONG)
    expect(here.page.locator("#go")).to_be_hidden()
    here.page.locator("#sessions button.link").click()
    expect(here.page.locator(".robot")).to_have_count(8, timeout=LONG)
    server.client.delete(session)
    expect(here.page.locator("#start-problem")).to_contain_text("deleted", timeout=LONG)


def test_words_are_about_what_was_just_pointed_at(server: Any, visit: Any) -> None:
    here = visit(server.url)
    here.begin()
    here.say("Surround the largest coin")
    here.page.click("[data-tool=point]")
    here.page.locator('.thing[data-id="c2"]').press("Enter", timeout=LONG)
    expect(here.page.locator("#pointed .chip")).to_have_count(1, timeout=LONG)
    here.say("9 robots around it")
    scene = server.client.get(f"{here.session}/scene").json()
    (group,) = scene["plan"]["groups"]
    assert (group["targets"], group["robots"]) == (["t2"], 9)


def accepting(text: str) -> Callable[[Dialog], None]:
    def accept(dialog: Dialog) -> None:
        dialog.accept(text)

    return accept


def test_sessions_are_found_renamed_and_deleted(server: Any, visit: Any) -> None:
    here = visit(server.url)
    here.begin()
    here.say("Surround the largest coin")
    here.page.click("#home")
    rows = here.page.locator("#sessions li")
    expect(rows).to_have_count(1, timeout=LONG)
    here.page.once("dialog", accepting("my coins"))
    rows.get_by_role("button", name="Rename").click()
    expect(rows).to_contain_text("my coins", timeout=LONG)
    here.page.fill("#search", "no such words")
    expect(rows).to_have_text("None.", timeout=LONG)
    here.page.fill("#search", "coins")
    here.page.once("dialog", accepting(""))
    rows.get_by_role("button", name="Delete").click()
    expect(rows).to_have_text("None.", timeout=LONG)
    assert server.client.get("/api/sessions").json() == []


def test_fingers_drag_a_robot_and_pinch_the_picture(server: Any, visit: Any) -> None:
    here = visit(server.url, viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    here.begin()
    here.say("Surround the largest coin")
    here.page.locator("#scene").scroll_into_view_if_needed()
    fingers = here.page.context.new_cdp_session(here.page)

    def touch(kind: str, *points: tuple[float, float]) -> None:
        at = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)]
        fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": at})

    box = here.robot(3).locator(".disc").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    touch("touchStart", (x, y))
    for step in range(1, 6):
        touch("touchMove", (x + 3 * step, y + 2 * step))
    expect(here.page.locator("#certificate .badge")).to_be_visible()
    touch("touchEnd")
    expect(here.page.locator("#log > li[data-status]")).to_have_count(2, timeout=LONG)
    expect(here.page.locator("#log > li").last).to_contain_text("Robot 3 moved")
    here.rest()
    scene = here.page.locator("#scene").bounding_box()
    middle = scene["x"] + scene["width"] / 2, scene["y"] + 30
    width = here.page.evaluate("document.querySelector('#scene').viewBox.baseVal.width")
    touch("touchStart", (middle[0] - 20, middle[1]), (middle[0] + 20, middle[1]))
    for step in range(1, 6):
        away = 20 + 12 * step
        touch("touchMove", (middle[0] - away, middle[1]), (middle[0] + away, middle[1]))
    touch("touchEnd")
    now = here.page.evaluate("document.querySelector('#scene').viewBox.baseVal.width")
    assert now < width / 2
    expect(here.page.locator("#log > li[data-status]")).to_have_count(2)
