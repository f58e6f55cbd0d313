"""Time, flows of control and the resources that computing takes.

``api`` is the contract, kept by ``virtual`` and ``wall``; ``processor`` and ``network`` are resources in
contention; ``timer``, ``interrupt``, ``pacing`` and ``watchdog`` are parts of the two clocks. Two doors:
``api``, ``task`` and ``waiting`` are for everybody; ``virtual``, ``wall``, ``processor`` and ``network`` are
opened by ``run`` alone. The kernel serves amounts of time; it must not know what they are for or what sets
their price.
"""
