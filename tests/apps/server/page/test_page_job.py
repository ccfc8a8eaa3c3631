"""The whole job in a browser: by mouse, by keyboard, by touch; stop; two pages at once."""

import gzip
from importlib import resources
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import expect

PHOTOS = Path(__file__).parents[4] / "evals/photos/images"
LONG = 20_000


def test_a_picture_of_ones_own_to_a_team_that_moved(server: Any, visit: Any) -> None:
    here = visit(server.url)
    page = here.page
    page.goto(here.url)
    page.fill("#robots", "8")
    page.set_input_files("#file", PHOTOS / "us_coins.jpg")
    expect(page.locator("#scene image")).to_be_attached(timeout=LONG)
    page.click("[data-tool=box]")
    stage = page.locator("#scene image").bounding_box()
    scale = stage["width"] / 568
    x0, y0, x1, y1 = 175, 28, 316, 162
    page.mouse.move(stage["x"] + x0 * scale, stage["y"] + y0 * scale)
    page.mouse.down()
    page.mouse.move(stage["x"] + x1 * scale, stage["y"] + y1 * scale, steps=5)
    page.mouse.up()
    expect(page.locator("#pointed .chip")).to_contain_text("confidence", timeout=LONG)
    here.say("Surround it, 20 px from it")
    expect(page.locator(".robot")).to_have_count(8)
    expect(page.locator("#certificate .badge")).to_have_text("certified")
    assert server.client.get(here.session).json()["last"]["targets"][0]["found_from"] == "box"

    page.click("[data-tool=move]")
    first = server.client.get(here.session).json()["current"]
    here.drag(3, 12, 8)
    expect(page.locator("#log > li[data-status]")).to_have_count(2, timeout=LONG)
    here.rest()
    moved = server.client.get(here.session).json()["current"]
    assert moved != first
    page.click("#undo")
    expect(page.locator("#log > li[data-status]")).to_have_count(3, timeout=LONG)
    here.rest()
    assert server.client.get(here.session).json()["current"] == first
    page.click("#redo")
    expect(page.locator("#log > li[data-status]")).to_have_count(4, timeout=LONG)
    here.rest()
    assert server.client.get(here.session).json()["current"] == moved

    page.click("#go")
    expect(page.locator("#approval-text")).to_contain_text(f"Plan {moved}: 8 robots")
    expect(page.locator("#approval-text")).to_contain_text("The longest path is")
    page.click("#approve")
    expect(page.locator("#log > li[data-status=deployed]")).to_have_count(1, timeout=LONG)
    expect(page.locator("#certificate")).to_contain_text("All robots were seen at their places")


def test_by_keyboard_alone(server: Any, visit: Any) -> None:
    here = visit(server.url)
    page, press = here.page, here.page.keyboard.press
    page.goto(here.url)
    page.locator("#examples button").first.wait_for(timeout=LONG)
    for _ in range(20):
        press("Tab")
        if page.evaluate("document.activeElement.closest('#examples') !== null"):
            break
    press("Enter")
    expect(page.locator("#scene image")).to_be_attached(timeout=LONG)
    expect(page.locator("#words")).to_be_focused()
    press("Enter")
    expect(page.locator(".robot")).to_have_count(8, timeout=LONG)
    here.rest()
    before = server.client.get(here.session).json()["current"]
    for _ in range(60):
        if page.evaluate("document.activeElement.dataset.number ?? ''") == "2":
            break
        press("Tab")
    for _ in range(3):
        press("ArrowLeft")
    press("Enter")
    expect(page.locator("#log > li[data-status]")).to_have_count(2, timeout=LONG)
    here.rest()
    after = server.client.get(here.session).json()["current"]
    assert after != before
    assert page.evaluate("document.activeElement.dataset.number") == "2"
    press("Control+z")
    expect(page.locator("#log > li[data-status]")).to_have_count(3, timeout=LONG)
    here.rest()
    assert server.client.get(here.session).json()["current"] == before
    for _ in range(60):
        if page.evaluate("document.activeElement.id") == "go":
            break
        press("Tab")
    press("Enter")
    expect(page.locator("#approval")).to_be_visible()
    for _ in range(4):
        if page.evaluate("document.activeElement.id") == "approve":
            break
        press("Tab")
    press("Enter")
    expect(page.locator("#log > li[data-status=deployed]")).to_have_count(1, timeout=LONG)


def test_by_touch_on_a_phone(server: Any, visit: Any) -> None:
    phone = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
    here = visit(server.url, **phone)
    page = here.page
    page.goto(here.url)
    page.locator("#examples button").first.tap()
    expect(page.locator("#scene image")).to_be_attached(timeout=LONG)
    page.locator("[data-tool=point]").tap()
    stage = page.locator("#scene image").bounding_box()
    share = stage["width"] / 568
    page.touchscreen.tap(stage["x"] + 246 * share, stage["y"] + 96 * share)
    expect(page.locator("#pointed .chip")).to_contain_text("confidence", timeout=LONG)
    page.fill("#words", "Surround it")
    page.locator("#send").tap()
    expect(page.locator(".robot")).to_have_count(8, timeout=LONG)
    here.rest()
    page.locator("#go").tap()
    page.locator("#approve").tap()
    expect(page.locator("#log > li[data-status=deployed]")).to_have_count(1, timeout=LONG)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_one_key_holds_the_robots(server: Any, visit: Any) -> None:
    here = visit(server.url)
    here.begin()
    here.say("Surround the largest coin")
    here.page.click("#go")
    here.page.click("#approve")
    expect(here.page.locator("#stop.urgent")).to_have_count(1, timeout=LONG)
    here.page.wait_for_timeout(600)
    here.page.keyboard.press("Escape")
    expect(here.page.locator("#log > li[data-status=stopped]")).to_have_count(1, timeout=LONG)
    scene = server.client.get(f"{here.session}/scene").json()
    places = {robot["id"]: (robot["x"], robot["y"]) for robot in scene["plan"]["robots"]}
    stood = {robot["id"]: (robot["x"], robot["y"]) for robot in scene["robots"]}
    assert any(abs(stood[i][0] - places[i][0]) > 5 for i in places)


def test_two_pages_on_one_session_show_the_same(server: Any, visit: Any) -> None:
    one, other = visit(server.url), visit(server.url)
    one.begin()
    other.page.goto(one.page.url)
    one.say("Surround the largest coin")
    expect(other.page.locator(".robot")).to_have_count(8, timeout=LONG)
    expect(other.page.locator("#log")).to_contain_text("8 robots have certified places")
    other.say("a bit further out")
    expect(one.page.locator("#log > li[data-status]")).to_have_count(2, timeout=LONG)
    current = server.client.get(one.session).json()["current"]
    for here in (one, other):
        expect(here.page.locator(f'#strip [aria-label^="Plan {current}"]')).to_have_class("here")
    one.page.reload()
    expect(one.page.locator("#log > li[data-status]")).to_have_count(2, timeout=LONG)
    expect(one.page.locator(".robot")).to_have_count(8)


def test_a_question_is_answered_on_the_picture(server: Any, visit: Any) -> None:
    here = visit(server.url)
    here.begin()
    here.say("Surround the coin")
    assert here.status() == "question"
    spots = here.page.locator(".option")
    assert spots.count() == here.page.locator("#options button").count() >= 5
    spots.nth(1).locator("circle").click()
    expect(here.page.locator(".robot")).to_have_count(8, timeout=LONG)
    here.rest()
    expect(here.page.locator("#log > li").last).to_contain_text("c2")
    expect(here.page.locator(".option")).to_have_count(0)


def test_words_that_would_answer_a_question_are_buttons(server: Any, visit: Any) -> None:
    here = visit(server.url)
    here.begin()
    here.say("Surround the largest coin")
    here.say("Make it wigglier")
    assert here.status() == "question"
    offered = here.page.locator("#options button").all_inner_texts()
    assert offered == ["a bit further out", "turn it 30 degrees"]
    here.page.click("#options button >> nth=1")
    here.rest()
    expect(here.page.locator("#log > li").last).to_contain_text("degrees")
    assert here.status() == "planned"
    expect(here.page.locator("#options button")).to_have_count(0)


def test_a_dragged_robot_that_breaks_the_contract_stands_by_itself(server: Any, visit: Any) -> None:
    here = visit(server.url)
    here.begin()
    here.say("Surround the largest coin, 20 px from it")
    here.page.uncheck("#snap")
    box = here.robot(3).locator(".disc").bounding_box()
    here.page.mouse.move(box["x"] + 5, box["y"] + 5)
    here.page.mouse.down()
    here.page.mouse.move(box["x"] - 60, box["y"] + 90, steps=4)
    expect(here.page.locator("#certificate .badge")).to_have_text("not certified", timeout=LONG)
    expect(here.page.locator(".robot.wrong")).not_to_have_count(0)
    here.page.mouse.up()
    expect(here.page.locator("#log > li[data-status]")).to_have_count(2, timeout=LONG)
    here.rest()
    expect(here.page.locator("#log > li").last).to_contain_text("Robot 3 moved, by itself")
    expect(here.page.locator("#certificate")).to_contain_text("stands by itself")


def test_an_outline_is_corrected_by_points_on_it_and_off_it(server: Any, visit: Any) -> None:
    here = visit(server.url)
    page = here.page
    here.begin()
    page.click("[data-tool=point]")
    expect(page.locator(".thing")).not_to_have_count(0, timeout=LONG)
    stage = page.locator("#scene image").bounding_box()
    scale = stage["width"] / 568

    def click(x: float, y: float) -> Any:
        with page.expect_request("**/outline") as asked:
            page.mouse.click(stage["x"] + x * scale, stage["y"] + y * scale)
        asked.value.response().finished()
        return asked.value.post_data_json["prompt"]

    assert click(246, 96)["candidate"].startswith("c")
    expect(page.locator("#pointed .chip")).to_have_count(1, timeout=LONG)
    page.click("[data-tool=plus]")
    corrected = click(246, 40)
    assert corrected["points"] == [[pytest.approx(246, abs=1), pytest.approx(40, abs=1)]]
    assert len(corrected["outline"]) > 10 and "candidate" not in corrected
    page.click("[data-tool=minus]")
    again = click(350, 96)
    assert len(again["points"]) == len(again["negative"]) == 1
    expect(page.locator("#pointed .chip")).to_have_count(1)
    page.click("#pointed button")
    expect(page.locator("#pointed .chip")).to_have_count(0)
    expect(page.locator("[data-tool=minus]")).to_be_disabled()


def test_sliders_try_and_then_change_the_plan(server: Any, visit: Any) -> None:
    here = visit(server.url)
    here.begin()
    here.say("Surround the largest coin")
    here.page.get_by_role("slider", name="Distance, px").focus()
    for _ in range(3):
        here.page.keyboard.press("ArrowRight")
    expect(here.page.locator("#log > li[data-status]")).to_have_count(2, timeout=LONG)
    here.rest()
    assert here.page.evaluate("document.activeElement.ariaLabel") == "Distance, px"
    here.page.get_by_role("slider", name="Robots").fill("11")
    expect(here.page.locator(".robot")).to_have_count(11, timeout=LONG)


def test_problems_stand_where_they_arise(server: Any, visit: Any) -> None:
    here = visit(server.url)
    page = here.page
    page.goto(here.url)
    text = {"name": "notes.txt", "mimeType": "text/plain", "buffer": b"surround the coin"}
    page.set_input_files("#file", text)
    expect(page.locator("#start-problem")).to_contain_text("notes.txt", timeout=LONG)
    here.begin()
    page.click("[data-tool=point]")
    page.locator("#scene").click(position={"x": 4, "y": 4})
    expect(page.locator("#stage-problem")).to_contain_text("outside the picture", timeout=LONG)
    here.say("Make the coin happy")
    assert here.status() in ("question", "impossible")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_tokens_are_asked_for(serve: Any, visit: Any, tmp_path: Path, scheme: str) -> None:
    from formup.apps.server.tokens import Tokens

    file = tmp_path / "tokens.json"
    token = Tokens(file).add("ann", "move")
    here = visit(serve(tokens=file).url, color_scheme=scheme)
    here.page.goto(here.url)
    expect(here.page.locator("#sign-in")).to_be_visible(timeout=LONG)
    refused = here.page.locator("#not-accepted")
    expect(refused).to_be_hidden()
    here.page.fill("#token", token[:-1])
    here.page.keyboard.press("Enter")
    expect(refused).to_contain_text("This token was not accepted", timeout=LONG)
    here.page.fill("#token", token)
    here.page.keyboard.press("Enter")
    here.page.locator("#examples button").first.click(timeout=LONG)
    expect(here.page.locator("#scene image")).to_be_attached(timeout=LONG)


def test_a_token_that_may_not_move_is_offered_no_move(
    serve: Any, visit: Any, tmp_path: Path
) -> None:
    from formup.apps.server.tokens import Tokens

    file = tmp_path / "tokens.json"
    token = Tokens(file).add("pat", "plan")
    here = visit(serve(tokens=file).url)
    here.page.goto(here.url)
    here.page.fill("#token", token)
    here.page.keyboard.press("Enter")
    here.page.locator("#examples button").first.click(timeout=LONG)
    expect(here.page.locator("#scene image")).to_be_attached(timeout=LONG)
    here.say("Surround the largest coin")
    told = "Your token has the scope plan; moving the robots needs move."
    expect(here.page.locator("#may-not")).to_have_text(told, timeout=LONG)
    expect(here.page.locator("#go")).to_be_hidden()


def test_a_shared_link_shows_what_happens_and_lets_nothing_be_done(server: Any, visit: Any) -> None:
    here, other = visit(server.url), visit(server.url)
    here.begin()
    here.say("Surround the largest coin")
    here.page.click("#share")
    expect(here.page.locator("#shared")).to_be_visible(timeout=LONG)
    other.page.goto(here.page.input_value("#link"))
    here.page.keyboard.press("Escape")
    expect(other.page.locator(".robot")).to_have_count(8, timeout=LONG)
    for hidden in ("#composer", "#go", "#undo", "#stop", "[data-tool=point]"):
        expect(other.page.locator(hidden)).to_be_hidden()
    here.say("take two away")
    expect(other.page.locator(".robot")).to_have_count(6, timeout=LONG)


def test_the_page_is_small(server: Any) -> None:
    files = resources.files("formup") / "apps/page"
    sizes = [len(gzip.compress(f.read_bytes())) for f in files.iterdir() if f.is_file()]
    assert sum(sizes) < 150_000


def test_words_are_text_and_never_markup(server: Any, visit: Any) -> None:
    here = visit(server.url)
    here.begin()
    here.say('Surround <img src="https://elsewhere.example/x" onerror="document.title=1">')
    here.page.fill("#words", "<script>document.title = 1</script>")
    expect(here.page.locator("#log img, #log script")).to_have_count(0)
    expect(here.page.locator("#log")).to_contain_text("<img src=")
    policy = here.page.request.get(here.url).headers["content-security-policy"]
    assert "unsafe" not in policy and policy.startswith("default-src 'none'")
