"""``tf2_ros.Buffer``: the tree that a listener fills and a program asks."""

from __future__ import annotations

from typing import Any, ClassVar

from volery.base.time import Ns, S, from_seconds
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal
from volery.ros.client_libraries.tf2.errors import InvalidArgumentException, TransformException
from volery.ros.client_libraries.tf2.geometry import from_transform, write_transform
from volery.ros.client_libraries.tf2.stamped import transformed
from volery.ros.client_libraries.tf2.tree import Tree
from volery.ros.messages import new
from volery.ros.messages.stamp import nanoseconds


def as_ns(value: Any) -> Ns:
    """A time or a duration of rospy or of rclpy, a message of either, or seconds."""
    if isinstance(value, (int, float)):
        return from_seconds(value)
    found = getattr(value, "nanoseconds", None)
    return nanoseconds(value) if found is None else int(found)


class Buffer:
    """Transforms of the last ten seconds, or of *cache_time*."""

    kernel: ClassVar[Kernel]

    def __init__(self, cache_time: Any = None, *options: Any, **more: Any) -> None:
        self._tree = Tree(10 * S if cache_time is None else as_ns(cache_time))
        self._learnt = Signal(self.kernel, "tf2_ros.Buffer (a transform)")

    def set_transform(self, transform: Any, authority: str = "", *, static: bool = False) -> None:
        """Learn a ``geometry_msgs/msg/TransformStamped``."""
        header = transform.header
        rigid = from_transform(transform.transform)
        self._tree.learn(transform.child_frame_id, header.frame_id, as_ns(header.stamp), rigid, static=static)
        self._learnt.notify()

    def set_transform_static(self, transform: Any, authority: str = "") -> None:
        """Learn one that holds at all times."""
        self.set_transform(transform, authority, static=True)

    def clear(self) -> None:
        """Forget what moves."""
        self._tree.clear()

    def all_frames_as_list(self) -> list[str]:
        """The frames that are known."""
        return self._tree.frames()

    def can_transform(
        self,
        target_frame: str,
        source_frame: str,
        time: Any,
        timeout: Any = 0,
        return_debug_tuple: bool = False,
    ) -> Any:
        """Whether ``lookup_transform`` would succeed within *timeout*; with the reason if asked for it."""
        why = self._why_not(target_frame, source_frame, as_ns(time), as_ns(timeout))
        return (not why, why) if return_debug_tuple else not why

    def _why_not(self, target: str, source: str, at: Ns, within: Ns) -> str:
        found: list[str] = [""]

        def can() -> bool:
            try:
                self._tree.look_up(target, source, at)
            except TransformException as error:
                found[0] = str(error)
                return False
            found[0] = ""
            return True

        with self.kernel:
            if not can() and within > 0:
                self._learnt.wait_for(can, within, ends_activation=True)
        return found[0]

    def lookup_transform(self, target_frame: str, source_frame: str, time: Any, timeout: Any = 0) -> Any:
        """The ``TransformStamped`` from *source_frame* to *target_frame* at *time* (0: the latest).

        Blocks for at most *timeout* until there is one. Raises what tf2 does.
        """
        at = as_ns(time)
        self._why_not(target_frame, source_frame, at, as_ns(timeout))
        found, rigid = self._tree.look_up(target_frame, source_frame, at)
        made = new("geometry_msgs/msg/TransformStamped", child_frame_id=source_frame)
        made.header.frame_id = target_frame
        made.header.stamp.sec, made.header.stamp.nanosec = divmod(found, S)
        write_transform(made.transform, rigid)
        return made

    def lookup_transform_full(
        self,
        target_frame: str,
        target_time: Any,
        source_frame: str,
        source_time: Any,
        fixed_frame: str,
        timeout: Any = 0,
    ) -> Any:
        """From *source_frame* then to *target_frame* at another time, by what has not moved meanwhile."""
        source = self.lookup_transform(fixed_frame, source_frame, source_time, timeout)
        target = self.lookup_transform(target_frame, fixed_frame, target_time, timeout)
        joined = from_transform(source.transform).then(from_transform(target.transform))
        target.child_frame_id = source_frame
        write_transform(target.transform, joined)
        return target

    def transform(
        self, object_stamped: Any, target_frame: str, timeout: Any = 0, new_type: Any = None
    ) -> Any:
        """A stamped point, vector or pose in another frame."""
        if new_type is not None:
            raise InvalidArgumentException(
                "Buffer.transform(new_type=...) is not there on the embedded graph"
            )
        header = object_stamped.header
        return transformed(
            object_stamped, self.lookup_transform(target_frame, header.frame_id, header.stamp, timeout)
        )
