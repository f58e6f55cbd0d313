"""Cost of computing: execution time, energy and power on a processor of the catalogue.

Other packages import from here and from ``cost.native``, not from the modules. ``ProcessorPrices`` is the way
from a law to a price; the laws themselves are for calibration, which determines them, and for reports.
``StepCounter`` counts what Python code does. The package does not know who calls, when, or what else runs:
it turns an amount and a frequency into ns, J or W, and says where its figures come from and how far they
are valid. A missing figure is an ``EstimateError``, never zero.
"""

from volery.cost.catalogue import (
    Catalogue,
    ListPrice,
    ProcessorEntry,
    Supply,
    load_catalogue,
    parse_catalogue,
    read_catalogue,
)
from volery.cost.code_laws import (
    CodeLaw,
    CoreLaw,
    IssueQueue,
    LibraryLaw,
    MemoryLaw,
    OperationTiming,
    PipeGroup,
    SimulatedCache,
)
from volery.cost.figures import (
    Figure,
    Line,
    PowerLaw,
    WithProvenance,
    line_through,
    scale_energy,
    scale_time,
)
from volery.cost.instrumentation import UNIFORM_COSTS, StepCounter
from volery.cost.library_calls import OWN, WRAPPED, LibraryCall, LibraryTable, library_table
from volery.cost.library_sizes import call_feature, call_size
from volery.cost.pricing import (
    FREE,
    Basis,
    Cost,
    CountedPricing,
    Pricing,
    ProcessorPrices,
    StatedCost,
    StatedPricing,
)
from volery.cost.python_operations import OPERATIONS, STEPS_PER_NS, OperationTable, operation_table
from volery.cost.ros_law import NOT_COUNTED, CallFigures, RosLaw
from volery.cost.tariff import Price, Tariff

__all__ = [
    "FREE",
    "NOT_COUNTED",
    "OPERATIONS",
    "OWN",
    "STEPS_PER_NS",
    "UNIFORM_COSTS",
    "WRAPPED",
    "Basis",
    "CallFigures",
    "Catalogue",
    "CodeLaw",
    "CoreLaw",
    "Cost",
    "CountedPricing",
    "Figure",
    "IssueQueue",
    "LibraryCall",
    "LibraryLaw",
    "LibraryTable",
    "Line",
    "ListPrice",
    "MemoryLaw",
    "OperationTable",
    "OperationTiming",
    "PipeGroup",
    "PowerLaw",
    "Price",
    "Pricing",
    "ProcessorEntry",
    "ProcessorPrices",
    "RosLaw",
    "SimulatedCache",
    "StatedCost",
    "StatedPricing",
    "StepCounter",
    "Supply",
    "Tariff",
    "WithProvenance",
    "call_feature",
    "call_size",
    "library_table",
    "line_through",
    "load_catalogue",
    "operation_table",
    "parse_catalogue",
    "read_catalogue",
    "scale_energy",
    "scale_time",
]
