"""Every exception formup raises on purpose, so that callers can catch one or all.

FormupError
├── InputError     a person gave something that cannot be used; the text says what would do
│   ├── ImageError     the picture file: missing, broken, too large, of a foreign format
│   └── StorageError   a log, state or artefact that cannot be read or written
├── ToolError      a model asked a tool for something it cannot do; goes back to the model
│   └── ArgumentsError the arguments are against the tool's schema
├── ApprovalError  a person must approve a plan before real robots move
├── ModelError     a model or its provider failed, or does not exist
└── FleetError     robots could not be moved or observed
"""


class FormupError(Exception):
    """Base of all errors whose message is meant to be read by a person or a model."""


class InputError(FormupError):
    """Bad input from a person: the message names the value, what is allowed, what to do."""


class ImageError(InputError):
    """A picture that cannot be loaded safely."""


class StorageError(InputError):
    """A log, a state file or an artefact that cannot be read or written."""


class ToolError(FormupError):
    """A tool cannot do what its arguments ask; the model is told why and may repair.

    Attributes:
        images: PNG or JPEG files that show why, for models that see.
    """

    images: tuple[bytes, ...] = ()

    def showing(self, *images: bytes) -> "ToolError":
        """The same error with pictures."""
        self.images = images
        return self


class ArgumentsError(ToolError):
    """Arguments against the tool's schema; the text names every violation."""


class ApprovalError(FormupError):
    """Real robots wait for a person's approval of exactly this plan.

    Attributes:
        plan_id: of the plan.
    """

    def __init__(self, plan_id: str) -> None:
        super().__init__(f"Plan {plan_id} moves real robots and waits for a person's approval.")
        self.plan_id = plan_id


class ModelError(FormupError):
    """A model, or the service behind it, could not answer."""


class FleetError(FormupError):
    """The fleet could not be reached, moved or observed."""
