"""OpenTelemetry spans of a run by the GenAI semantic conventions, to watch many runs.

They say what ran, for how long, at what cost and how it ended, never what was said: no messages,
instructions, arguments, results or keys, and of errors only the kind, since their sentences may
repeat what was said. The trace of the run holds all that.
"""

import functools
import inspect
import os
import sys
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

from ...tools.errors import InputError
from ...tools.tool import Tool
from ..messages import History, Reply, replies_of
from ..model import Model, Request
from ..outcomes import Outcome, Stopped
from ..report import Report

if TYPE_CHECKING:
    from opentelemetry.sdk.trace.export import SpanExporter
    from opentelemetry.trace import Span, Tracer

NAME = "formup"
"""Name of the agent, the service and the instrumentation."""
_PROVIDERS = {"openai-responses": "openai", "gemini": "gcp.gemini"}
"""The conventions' names of providers, where they differ from ours."""
_ENDPOINTS = ("OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT")
_LACKING = "OpenTelemetry is not installed; pip install 'formup[otel]'."

RecordEnd = Callable[[Outcome, Report], None]


def traced_model(model: Model, tracer: "Tracer") -> Model:
    """Return the model with a span around each reply; `prompt`, `aclose` and so on stay its own."""
    return _TracedModel(model, tracer)


class _TracedModel:
    def __init__(self, model: Model, tracer: "Tracer") -> None:
        self._model, self._tracer = model, tracer

    @property
    def name(self) -> str:
        return self._model.name

    async def reply(self, request: Request) -> Reply:
        asked = _model_attributes(self.name)
        with _span(self._tracer, "chat", asked["gen_ai.request.model"], asked) as span:
            reply = await self._model.reply(request)
            span.set_attributes(_usage((reply,)))
            return reply

    def __getattr__(self, name: str) -> Any:
        return getattr(self._model, name)


def traced_tool(tool: Tool, tracer: "Tracer") -> Tool:
    """Return the tool with a span around each time it works.

    A call that is refused or violates the schema does not get that far and has no span; neither
    has a plain function that was given up and never ends.
    """
    facts = {
        "gen_ai.tool.name": tool.name,
        "gen_ai.tool.type": "function",
        "gen_ai.tool.description": tool.description,
    }
    function: Callable[..., Any] = tool.function
    if not inspect.iscoroutinefunction(function):
        spanned = _span(tracer, "execute_tool", tool.name, facts)  # opens a new span for each call
        return replace(tool, function=spanned(function))

    @functools.wraps(function)
    async def waiting(*args: Any, **values: Any) -> Any:
        with _span(tracer, "execute_tool", tool.name, facts):
            return await function(*args, **values)

    return replace(tool, function=waiting)


@contextmanager
def traced_run(
    tracer: "Tracer | None", model: str, before: History
) -> Generator[RecordEnd, None, None]:
    """Open a span around a whole run and yield what records its end; do nothing without a tracer.

    Args:
        model: the model's name.
        before: messages of earlier runs, which have counted what these used.
    """
    if tracer is None:
        yield lambda outcome, report: None
        return
    facts = _model_attributes(model) | {"gen_ai.agent.name": NAME}
    with _span(tracer, "invoke_agent", NAME, facts) as span:

        def told(outcome: Outcome, report: Report) -> None:
            made = outcome.messages[len(before) :]
            replies = tuple(replies_of(made))
            span.set_attributes(_usage(replies))
            span.set_attribute("formup.status", report.status)
            span.set_attribute("formup.requests", len(replies))
            span.set_attribute("formup.tool_calls", sum(len(r.calls) for r in replies))
            span.set_attribute("formup.cost_usd", sum(r.usage.cost_usd for r in replies))
            if isinstance(outcome, Stopped):
                _failed(span, outcome.kind)
            elif report.status == "failed":
                _failed(span, "fleet")  # robots have not arrived

        yield told


@contextmanager
def environment_tracer() -> "Generator[Tracer | None, None, None]":
    """Yield the tracer that OpenTelemetry's environment variables ask for, or None.

    What it has recorded is sent at the end, at the latest.

    Raises:
        InputError: the extra is missing, or the variables ask for an unknown exporter.
    """
    if (kind := _exporter_wanted()) is None:
        yield None
        return
    try:
        from opentelemetry.sdk.resources import OTELResourceDetector, Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor

        exporter = _exporter(kind)
    except ImportError:
        raise InputError(_LACKING) from None
    # Detected last: the environment may give the service another name.
    resource = Resource.create({"service.name": NAME}).merge(OTELResourceDetector().detect())
    provider = TracerProvider(resource=resource, shutdown_on_exit=False)
    provider.add_span_processor(BatchSpanProcessor(exporter))
    try:
        yield provider.get_tracer(NAME)
    finally:
        provider.shutdown()


def _exporter_wanted() -> Literal["otlp", "console"] | None:
    if os.environ.get("OTEL_SDK_DISABLED", "").strip().lower() == "true":
        return None
    given = os.environ.get("OTEL_TRACES_EXPORTER", "").strip()
    if given in ("otlp", "console"):
        return given
    if given not in ("", "none"):
        raise InputError(
            f"OTEL_TRACES_EXPORTER={given} is not known here; otlp, console and none are."
        )
    asked = not given and any(os.environ.get(name, "").strip() for name in _ENDPOINTS)
    return "otlp" if asked else None


def _exporter(kind: Literal["otlp", "console"]) -> "SpanExporter":
    if kind == "console":
        from opentelemetry.sdk.trace.export import ConsoleSpanExporter

        return ConsoleSpanExporter(out=sys.stderr)  # a program may be reading stdout
    from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter

    return OTLPSpanExporter()


@contextmanager
def _span(
    tracer: "Tracer", operation: str, what: str, facts: Mapping[str, str]
) -> "Generator[Span, None, None]":
    """Open a span named and marked as the conventions say, without the text of an error."""
    from opentelemetry.trace import SpanKind

    with tracer.start_as_current_span(
        f"{operation} {what}",
        kind=SpanKind.CLIENT if operation == "chat" else SpanKind.INTERNAL,
        attributes={"gen_ai.operation.name": operation, **facts},
        record_exception=False,
        set_status_on_exception=False,
    ) as span:
        try:
            yield span
        except BaseException as error:  # a cancellation has to be seen as well
            _failed(span, type(error).__qualname__)
            raise


def _failed(span: "Span", kind: str) -> None:
    from opentelemetry.trace import StatusCode

    span.set_attribute("error.type", kind)
    span.set_status(StatusCode.ERROR)


def _model_attributes(name: str) -> dict[str, str]:
    """Return provider and model by a model's name; without a provider it runs in this process."""
    provider, colon, model = name.partition(":")
    return {
        "gen_ai.provider.name": _PROVIDERS.get(provider, provider) if colon else NAME,
        "gen_ai.request.model": model if colon else name,
    }


def _usage(replies: tuple[Reply, ...]) -> dict[str, int]:
    return {
        "gen_ai.usage.input_tokens": sum(r.usage.input_tokens for r in replies),
        "gen_ai.usage.cache_read.input_tokens": sum(r.usage.cached_tokens for r in replies),
        "gen_ai.usage.output_tokens": sum(r.usage.output_tokens for r in replies),
    }
