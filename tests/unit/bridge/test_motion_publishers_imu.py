"""What the sensors felt, in FLU and SI, whichever frame brings it."""

from typing import Any

import pytest

from volery.base.time import MS

from .test_motion_publishers import xyz

IMU, FIELD = "sensor_msgs/Imu", "sensor_msgs/MagneticField"
THOUSANDTHS = {
    "xacc": 100,
    "yacc": 200,
    "zacc": -1000,
    "xgyro": 10,
    "ygyro": 20,
    "zgyro": 30,
    "xmag": 200,
    "ymag": 30,
}
SI = {"xacc": 0.980665, "yacc": 1.96133, "zacc": -9.80665, "xgyro": 0.01, "ygyro": 0.02, "zgyro": 0.03}


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("RAW_IMU", THOUSANDTHS),
        ("SCALED_IMU", THOUSANDTHS),
        ("HIGHRES_IMU", {**SI, "xmag": 0.2, "ymag": 0.03}),
    ],
)
def test_a_measurement(rig: Any, name: str, fields: dict[str, float]) -> None:
    rig.connect()
    felt, magnetic = rig.listen("imu/data_raw", IMU), rig.listen("imu/mag", FIELD)
    together = rig.listen("imu/data", IMU)
    rig.emit(name, **fields)
    rig.emit("ATTITUDE", rollspeed=0.5)
    rig.run(200 * MS)
    [raw], [field], [data] = felt, magnetic, together
    assert xyz(raw.linear_acceleration) == pytest.approx((0.980665, -1.96133, 9.80665), rel=1e-6)
    assert xyz(raw.angular_velocity) == pytest.approx((0.01, -0.02, -0.03))
    assert raw.orientation_covariance[0] == -1.0  # there is none
    assert xyz(field.magnetic_field) == pytest.approx((2e-5, -3e-6, 0.0))
    assert xyz(data.linear_acceleration) == pytest.approx((0.980665, -1.96133, 9.80665), rel=1e-6)
    assert (data.header.frame_id, data.angular_velocity.x) == ("base_link", 0.5)


def test_the_better_source_wins(rig: Any) -> None:
    rig.connect()
    felt = rig.listen("imu/data_raw", IMU)
    rig.emit("RAW_IMU", zacc=-1000)
    rig.run(200 * MS)
    rig.emit("HIGHRES_IMU", zacc=-5.0)
    rig.run(200 * MS)
    rig.emit("RAW_IMU", zacc=-1000)
    rig.run(200 * MS)
    assert [message.linear_acceleration.z for message in felt] == pytest.approx([9.80665, 5.0])


def test_without_a_measurement_the_acceleration_is_unknown(rig: Any) -> None:
    rig.connect()
    received = rig.listen("imu/data", IMU)
    rig.emit("ATTITUDE")
    rig.run(200 * MS)
    assert received[0].linear_acceleration_covariance[0] == -1.0


def test_pressures_and_temperature(rig: Any) -> None:
    rig.connect()
    pressures = rig.listen("imu/static_pressure", "sensor_msgs/FluidPressure")
    differences = rig.listen("imu/diff_pressure", "sensor_msgs/FluidPressure")
    degrees = rig.listen("imu/temperature_imu", "sensor_msgs/Temperature")
    rig.emit("SCALED_PRESSURE", press_abs=910.5, press_diff=0.25, temperature=2150)
    rig.run(200 * MS)
    assert (pressures[0].fluid_pressure, differences[0].fluid_pressure) == (91_050.0, 25.0)
    assert degrees[0].temperature == 21.5
