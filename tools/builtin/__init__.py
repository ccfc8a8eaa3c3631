"""The tools a model sees: thin, one function a name, over perception, geometry and formation."""

from ..tool import Tool
from .committing import ask_user, deploy, propose_formation, report_impossible
from .deriving import derive_target
from .editing import edit_formation, undo
from .measuring import check_point, describe_shape, measure
from .sampling import sample_along_edges, sample_inside, sample_shape
from .seeing import locate_object, look, segment

TOOLS: tuple[Tool, ...] = (
    look,
    locate_object,
    segment,
    derive_target,
    describe_shape,
    check_point,
    sample_along_edges,
    sample_inside,
    sample_shape,
    measure,
    propose_formation,
    edit_formation,
    undo,
    deploy,
    ask_user,
    report_impossible,
)
