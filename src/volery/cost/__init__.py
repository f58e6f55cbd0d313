"""Laws of computing: what ROS calls, code and energy take on a processor of the catalogue.

Imports ``base`` only. It must not know who calls, when, or what else runs: it turns a kind, an amount and a
frequency into nanoseconds, joules or watts, and says where its figures come from and how far they reach. A
missing figure is an ``EstimateError``, never zero.
"""

from volery.cost.catalogue import Catalogue, Figure, ProcessorEntry, load_catalogue
from volery.cost.code_laws import CodeLaw
from volery.cost.figures import PowerLaw, scale_energy, scale_time
from volery.cost.ros_law import NOT_COUNTED, Price, RosLaw, Tariff

__all__ = [
    "NOT_COUNTED",
    "Catalogue",
    "CodeLaw",
    "Figure",
    "PowerLaw",
    "Price",
    "ProcessorEntry",
    "RosLaw",
    "Tariff",
    "load_catalogue",
    "scale_energy",
    "scale_time",
]
