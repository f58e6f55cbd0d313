"""C++ components: their sources become a shared library whose code runs in virtual time.

Each caller of a component has a fiber, a flow of control with a stack of its own. A request of the code
(publish, sleep, read the clock, call a required port) switches back to Python, which serves the request as
the component's task and resumes the fiber with the reply. ``runtime/`` is the C++ side; the ABI between the
two is declared in ``volery/ros/client_libraries/include/volery/abi.h``, since client libraries include it.
"""
