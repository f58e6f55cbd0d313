// The interface of a drone for controllers in C++: the same seven calls for every autopilot.
//
// Each call blocks until the height, the position or the ground is reached. It throws volery::Error with the
// autopilot's message if that fails.
#pragma once
#include <cstddef>

#include "volery/services.h"

// The drone at a required port of the interface Drone.
class I_RosDron {
public:
    explicit I_RosDron(const char* port = "", std::size_t index = 0) : port_(port), index_(index) {}

    // -- modes that need a position estimate. Call gps_fly before gps_go.

    // Arm and climb to a height in metres above home.
    void gps_fly(double height) { call("gps_fly", volery::Writer().put(height)); }
    // Fly to a position: degrees north, degrees east, metres above mean sea level.
    void gps_go(double latitude, double longitude, double altitude) {
        call("gps_go", volery::Writer().put(latitude).put(longitude).put(altitude));
    }
    // Return to the home position and land there.
    void return_ground() { call("return_ground"); }

    // -- manual modes

    // Hold these stick positions until the next call: pitch, roll and yaw -1000..1000 (forward, right and clockwise
    // are positive), throttle 0..1000 (500 keeps the altitude in alt_hold_fly). Call it before the two that follow.
    void joystick(int pitch, int roll, int throttle, int yaw) {
        call("joystick", volery::Writer().put(pitch).put(roll).put(throttle).put(yaw));
    }
    // Manual control of attitude and throttle.
    void stabilize_fly() { call("stabilize_fly"); }
    // Manual control of attitude and climb rate.
    void alt_hold_fly() { call("alt_hold_fly"); }
    // Descend at the current position until the drone is on the ground.
    void land_ground() { call("land_ground"); }

private:
    void call(const char* operation, const volery::Writer& with = {}) {
        volery::request("drone", volery::Writer().put(port_).put(index_).put(operation).put(with.bytes()));
    }
    const char* port_;
    std::size_t index_;
};

// The same calls for a component that commands one drone only.
inline void uc_drone_gps_fly(double height) { I_RosDron().gps_fly(height); }
inline void uc_drone_gps_go(double latitude, double longitude, double altitude) {
    I_RosDron().gps_go(latitude, longitude, altitude);
}
inline void uc_drone_return_ground() { I_RosDron().return_ground(); }
inline void uc_drone_joystick(int pitch, int roll, int throttle, int yaw) {
    I_RosDron().joystick(pitch, roll, throttle, yaw);
}
inline void uc_drone_stabilize_fly() { I_RosDron().stabilize_fly(); }
inline void uc_drone_alt_hold_fly() { I_RosDron().alt_hold_fly(); }
inline void uc_drone_land_ground() { I_RosDron().land_ground(); }
