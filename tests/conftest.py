"""For all tests: how fast a machine is, and how busy, is not what they are about; nor who started them."""

import signal

from hypothesis import HealthCheck, settings

settings.register_profile("patient", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("patient")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell starts what it sends to the background so,
    signal.signal(signal.SIGINT, signal.default_int_handler)  # and programs that tests start would inherit it
