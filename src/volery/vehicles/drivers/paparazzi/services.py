"""Settings of a Paparazzi aircraft as parameters: SETTING and GET_SETTING, answered by DL_VALUE.

Names are those of the aircraft's ``settings.xml``. The settings that this driver commands the aircraft by are
not written here: they change who has control, and start and stop motors. A flight plan is compiled into the
aircraft, and there is no protocol for logs or payloads.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isclose, nan

from volery.base.errors import NotArrived, Refused
from volery.base.time import MS, Ns
from volery.kernel.api import Action, Kernel
from volery.links.paparazzi_aircraft import AircraftSetting
from volery.vehicles.drivers.paparazzi.backend import PaparazziBackend
from volery.vehicles.drivers.paparazzi.decoder import AUTO2, KILL_THROTTLE, MODE
from volery.vehicles.services import Parameter, PartialServices

AGAIN: Ns = 800 * MS
TRIES = 8
AT_ONCE = 8
"""Settings that are requested together."""
REAL32 = 9
"""MAV_PARAM_TYPE_REAL32: every setting travels as a float."""
OWN = (AUTO2, KILL_THROTTLE, MODE)


class PaparazziServices(PartialServices):
    """``Services`` of one aircraft: its settings.

    Args:
        kernel: clock and tasks.
        backend: the aircraft.
    """

    def __init__(self, kernel: Kernel, backend: PaparazziBackend) -> None:
        super().__init__(backend.telemetry.name, "Paparazzi has no messages for it")
        self._kernel = kernel
        self._backend = backend
        self._own = {backend.aircraft.setting(name).number for name in OWN}

    def parameter_name(self, name: str) -> str:
        """See ``Services``."""
        return self._backend.aircraft.setting(name).name

    def _values_since(
        self, asked: str, settings: Sequence[AircraftSetting], send: Action
    ) -> dict[str, Parameter]:
        """Call *send* until a value of each setting has arrived since then; return the values."""
        decoder, changed = self._backend.decoder, self._backend.telemetry.changed
        began = self._kernel.now()

        def missing() -> list[str]:
            known = decoder.values
            return [setting.name for setting in settings if known.get(setting.number, (-1, 0.0))[0] < began]

        with self._kernel.joined():
            for _ in range(TRIES):
                with self._kernel.interact():
                    send()
                if changed.wait_for(lambda: not missing(), AGAIN, ends_activation=True):
                    return {
                        setting.name: Parameter(setting.name, decoder.values[setting.number][1], REAL32)
                        for setting in settings
                    }
        raise NotArrived(self._name, asked, f"no value of {', '.join(missing())} arrived")

    def read_parameter(self, name: str) -> Parameter:
        """See ``Services``."""
        setting = self._backend.aircraft.setting(name)
        found = self._values_since(
            f"read the setting {name}", [setting], lambda: self._backend.request_setting(setting)
        )
        return found[setting.name]

    def read_parameters(self) -> dict[str, Parameter]:
        """See ``Services``."""
        settings = self._backend.aircraft.settings
        found: dict[str, Parameter] = {}
        for first in range(0, len(settings), AT_ONCE):
            some = settings[first : first + AT_ONCE]

            def send(some: Sequence[AircraftSetting] = some) -> None:
                for one in some:
                    self._backend.request_setting(one)

            found |= self._values_since("read all settings", some, send)
        return found

    def write_parameter(self, name: str, value: float) -> Parameter:
        """See ``Services``."""
        setting = self._backend.aircraft.setting(name)
        asked = f"set the setting {name} to {value:g}"
        if setting.number in self._own:
            what = "it commands the aircraft: use arm(), hold(), land() and the other operations"
            raise Refused(self._name, asked, what)
        if not setting.low <= value <= setting.high:
            raise Refused(self._name, asked, f"it goes from {setting.low:g} to {setting.high:g}")
        if not self._backend.decoder.settings_checked:
            wrong = self._backend.wrong_setting() or "the numbers of its settings have not been checked yet"
            raise Refused(self._name, asked, wrong)
        decoder, changed = self._backend.decoder, self._backend.telemetry.changed

        def kept() -> bool:
            """A value that was sent before the aircraft has received this one may still arrive."""
            return isclose(decoder.values.get(setting.number, (0, nan))[1], value, rel_tol=1e-6, abs_tol=1e-6)

        decoder.values.pop(setting.number, None)
        with self._kernel.joined():
            for _ in range(TRIES):
                with self._kernel.interact():
                    self._backend.write_setting(setting, value)
                if changed.wait_for(kept, AGAIN, ends_activation=True):
                    return Parameter(setting.name, value, REAL32)
        if setting.number not in decoder.values:
            raise NotArrived(self._name, asked, "no value of it arrived")
        raise Refused(self._name, asked, f"the aircraft keeps {decoder.values[setting.number][1]:g}")
