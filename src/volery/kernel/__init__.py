"""Time, tasks, processors and networks.

``api`` is the interface that the clocks ``virtual`` and ``wall`` implement; ``processor`` and ``network`` are
contended resources; ``interrupts`` handles Ctrl-C and tasks that freeze virtual time. Any package may import
``api``, ``task`` and ``waiting``; only ``run`` makes kernels, processors and networks. The kernel serves
amounts of time and does not know what they are for or how they were priced.
"""
