"""formup's own server, with what the conformance suite of MCP looks for beside its tools.

Run with the folder of a store; it prints its port. The application, its guard and its endpoint are
those of `formup serve`; only the fixtures are of tests.
"""

import asyncio
import base64
import json
import socket
import sys
from typing import Any

import uvicorn
from formup.agent.agent import Agent
from formup.agent.service import Service
from formup.agent.store.places import store_at
from formup.apps.mcp.server import Endpoint
from formup.apps.server.app import make_app
from formup.apps.server.settings import ServerSettings
from formup.apps.server.tokens import Tokens
from mcp.server import MCPServer
from mcp.server.mcpserver import Context, UserMessage
from mcp.server.mcpserver.exceptions import ToolError
from mcp.shared.exceptions import MCPError
from mcp_types import (
    MISSING_REQUIRED_CLIENT_CAPABILITY,
    AudioContent,
    ElicitRequest,
    ElicitRequestFormParams,
    ElicitResult,
    EmbeddedResource,
    ImageContent,
    InputRequiredResult,
    TextContent,
    TextResourceContents,
)
from pydantic import BaseModel, Field
from starlette.routing import Route

PNG = (
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8z8DwHwAFBQIAX8jx0gAAAABJRU5ErkJg"
    "gg=="
)
WAV = "UklGRiYAAABXQVZFZm10IBAAAAABAAEAQB8AAAB9AAACABAAZGF0YQIAAAA="
IMAGE = ImageContent(data=PNG, mime_type="image/png")
TEXT = TextContent(text="A text.")
FIXTURE = "A fixture."


def resource(uri: str, text: str, kind: str = "text/plain") -> EmbeddedResource:
    return EmbeddedResource(resource=TextResourceContents(uri=uri, mime_type=kind, text=text))


class Response(BaseModel):
    response: str


class Defaults(BaseModel):
    name: str = "John Doe"
    age: int = 30
    score: float = 95.5
    status: str = Field("active", json_schema_extra={"enum": ["active", "inactive", "pending"]})
    verified: bool = True


def titled(**titles: str) -> list[Any]:
    return [{"const": value, "title": title} for value, title in titles.items()]


PLAIN = ["option1", "option2", "option3"]


class Enums(BaseModel):
    untitledSingle: str = Field(json_schema_extra={"enum": [*PLAIN]})  # noqa: N815
    titledSingle: str = Field(json_schema_extra={"oneOf": [*titled(a="A", b="B")]})  # noqa: N815
    untitledMulti: list[str] = Field(  # noqa: N815
        json_schema_extra={"items": {"type": "string", "enum": [*PLAIN]}}
    )
    titledMulti: list[str] = Field(  # noqa: N815
        json_schema_extra={"items": {"anyOf": [*titled(a="A", b="B")]}}
    )
    legacyEnum: str = Field(  # noqa: N815
        json_schema_extra={"enum": ["opt1", "opt2"], "enumNames": ["One", "Two"]}
    )


def asked(message: str, field: str, kind: str = "string") -> ElicitRequest:
    schema = {"type": "object", "properties": {field: {"type": kind}}, "required": [field]}
    return ElicitRequest(params=ElicitRequestFormParams(message=message, requested_schema=schema))


def answered(ctx: Context, key: str, field: str) -> Any:
    answer = (ctx.input_responses or {}).get(key)
    return (
        answer.content.get(field) if isinstance(answer, ElicitResult) and answer.content else None
    )


def add_content(server: MCPServer[Any], name: str, content: list[Any]) -> None:
    @server.tool(name=name, description=FIXTURE, structured_output=False)
    def answer() -> list[Any]:
        return content


def add_contents(server: MCPServer[Any]) -> None:
    contents: dict[str, list[Any]] = {
        "test_simple_text": [TEXT],
        "test_image_content": [IMAGE],
        "test_audio_content": [AudioContent(data=WAV, mime_type="audio/wav")],
        "test_embedded_resource": [resource("test://embedded-resource", "Embedded.")],
        "test_multiple_content_types": [
            TEXT,
            IMAGE,
            resource("test://mixed-content-resource", '{"a": 1}', "application/json"),
        ],
    }
    for name, content in contents.items():
        add_content(server, name, content)

    @server.tool(description=FIXTURE)
    def test_error_handling() -> str:
        raise ToolError("This tool intentionally returns an error for testing")

    @server.tool(description=FIXTURE)
    def test_missing_capability(ctx: Context) -> str:
        if ctx.client_capabilities is None or ctx.client_capabilities.sampling is None:
            data: dict[str, Any] = {"requiredCapabilities": {"sampling": {}}}
            raise MCPError(MISSING_REQUIRED_CLIENT_CAPABILITY, "No sampling is declared", data)
        return "declared"

    @server.tool(description=FIXTURE)
    async def test_tool_with_progress(ctx: Context) -> str:
        for done in (0, 50, 100):
            await ctx.report_progress(done, 100)
            await asyncio.sleep(0.05)
        return "done"


def add_question(server: MCPServer[Any], name: str, schema: type[BaseModel]) -> None:
    @server.tool(name=name, description=FIXTURE)
    async def ask(ctx: Context, message: str = "Please answer") -> str:
        told = await ctx.elicit(message, schema)
        content = told.data.model_dump_json() if told.action == "accept" else "{}"
        return f"User response: action={told.action}, content={content}"


def add_questions(server: MCPServer[Any]) -> None:
    add_question(server, "test_elicitation", Response)
    add_question(server, "test_elicitation_sep1034_defaults", Defaults)
    add_question(server, "test_elicitation_sep1330_enums", Enums)


def add_many_rounds(server: MCPServer[Any]) -> None:
    @server.tool(description=FIXTURE)
    async def test_input_required_result_multi_round(ctx: Context) -> str | InputRequiredResult:
        name = answered(ctx, "step1", "name") or json.loads(ctx.request_state or "{}").get("name")
        colour = answered(ctx, "step2", "color")
        if name is None:
            step = {"step1": asked("Your name?", "name")}
        elif colour is None:
            step = {"step2": asked("Your favourite colour?", "color")}
        else:
            return f"{name} likes {colour}."
        state = json.dumps({"name": name})
        return InputRequiredResult(input_requests={**step}, request_state=state)

    @server.tool(description=FIXTURE)
    async def test_input_required_result_capabilities(ctx: Context) -> InputRequiredResult:
        may = ctx.client_capabilities is None or ctx.client_capabilities.elicitation is not None
        requests = {"ask": asked("Your name?", "name")} if may else {}
        return InputRequiredResult(input_requests={**requests}, request_state="gated")


def add_rounds(server: MCPServer[Any]) -> None:
    @server.tool(description=FIXTURE)
    async def test_input_required_result_elicitation(ctx: Context) -> str | InputRequiredResult:
        if (name := answered(ctx, "user_name", "name")) is not None:
            return f"Hello, {name}!"
        return InputRequiredResult(input_requests={"user_name": asked("Your name?", "name")})

    @server.tool(description=FIXTURE)
    async def test_input_required_result_request_state(ctx: Context) -> str | InputRequiredResult:
        if ctx.request_state == "nonce" and answered(ctx, "confirm", "ok") is not None:
            return "state-ok"
        confirm = asked("Please confirm", "ok", "boolean")
        return InputRequiredResult(input_requests={"confirm": confirm}, request_state="nonce")

    @server.tool(description=FIXTURE)
    async def test_input_required_result_tampered_state(ctx: Context) -> str | InputRequiredResult:
        if ctx.request_state is not None:
            return f"state-ok: {ctx.request_state}"
        confirm = asked("Please confirm", "ok", "boolean")
        return InputRequiredResult(input_requests={"confirm": confirm}, request_state="round-1")

    @server.prompt(description=FIXTURE)
    async def test_input_required_result_prompt(
        ctx: Context,
    ) -> list[UserMessage] | InputRequiredResult:
        if (said := answered(ctx, "user_context", "context")) is not None:
            return [UserMessage(content=f"Use the following context: {said}")]
        return InputRequiredResult(input_requests={"user_context": asked("Context?", "context")})


def add_reading(server: MCPServer[Any]) -> None:
    @server.resource("test://static-text")
    def text() -> str:
        return "The static text."

    @server.resource("test://static-binary", mime_type="image/png")
    def binary() -> bytes:
        return base64.b64decode(PNG)

    @server.resource("test://template/{id}/data")
    def template(id: str) -> str:
        return json.dumps({"id": id, "templateTest": True, "data": f"Data for ID: {id}"})

    @server.prompt(description=FIXTURE)
    def test_simple_prompt() -> str:
        return "This is a simple prompt for testing."

    @server.prompt(description=FIXTURE)
    def test_prompt_with_arguments(arg1: str, arg2: str) -> str:
        return f"Prompt with arguments: arg1='{arg1}', arg2='{arg2}'"

    @server.prompt(description=FIXTURE)
    def test_prompt_with_embedded_resource(resourceUri: str) -> list[UserMessage]:  # noqa: N803
        return [UserMessage(content=resource(resourceUri, "Embedded.")), UserMessage(content=TEXT)]

    @server.prompt(description=FIXTURE)
    def test_prompt_with_image() -> list[UserMessage]:
        return [UserMessage(content=IMAGE), UserMessage(content=TEXT)]


def main() -> None:
    service = Service(Agent(), store_at(sys.argv[1]))
    app = make_app(service, ServerSettings.of({}), Tokens(None))
    [endpoint] = (
        route.endpoint
        for route in app.routes
        if isinstance(route, Route) and isinstance(route.endpoint, Endpoint)
    )
    for add in (add_contents, add_questions, add_rounds, add_many_rounds, add_reading):
        add(endpoint.server)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        print(listening.getsockname()[1], flush=True)  # noqa: T201
        config = uvicorn.Config(app, lifespan="on", log_level="warning")
        uvicorn.Server(config).run([listening])


if __name__ == "__main__":
    main()
