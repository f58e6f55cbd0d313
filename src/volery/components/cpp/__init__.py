"""The host of C++ components: their sources become a shared object, and its code runs in virtual time.

Each component has flows of control on stacks of their own. What the code asks of the house (publish, sleep,
the time, a required port) switches back to Python, which does it as the component's task, and goes on with
the answer. ``runtime/`` is the C++ side of that.
"""
