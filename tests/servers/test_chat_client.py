"""litellm's client, in its own environment, talks to formup's server as to OpenAI's."""

import base64
import json
from collections.abc import Callable
from pathlib import Path

PHOTO = Path(__file__).parents[2] / "evals/photos/images/us_coins.jpg"
CLIENT = """
import json, sys
import litellm

given = json.load(sys.stdin)
answers = []
for words in given["words"]:
    given["messages"].append({"role": "user", "content": words})
    asked = dict(model="openai/formup", api_base=given["url"], api_key="none")
    whole = litellm.completion(messages=given["messages"], **asked)
    again = litellm.completion(messages=given["messages"], stream=True, **asked)
    text = "".join(chunk.choices[0].delta.content or "" for chunk in again)
    answers.append([whole.choices[0].message.content, text])
    given["messages"].append({"role": "assistant", "content": text})
print(json.dumps(answers))
"""


def test_litellm_talks_to_formup(served: str, python: Callable[[str, str, str], str]) -> None:
    photo = base64.b64encode(PHOTO.read_bytes()).decode()
    image = {"type": "image_url", "image_url": {"url": f"data:image/jpeg;base64,{photo}"}}
    first = [{"type": "text", "text": "Cage the largest coin with 10 robots"}, image]
    given = {"url": f"{served}/v1", "messages": [], "words": [first, "a bit further out", "go"]}
    answers = json.loads(python("litellm", CLIENT, json.dumps(given)).splitlines()[-1])
    shown = ("certified", "certified", "arrived")
    for (whole, streamed), shows in zip(answers, shown, strict=True):
        assert shows in whole
        assert streamed == whole, "the same request is answered again and not done again"
