// angles: angles in radians, normalised, and the shortest way between two of them.
#pragma once
#include <cmath>

namespace angles {

inline double from_degrees(double degrees) { return degrees * M_PI / 180.0; }
inline double to_degrees(double radians) { return radians * 180.0 / M_PI; }
// From 0 up to 2 pi.
inline double normalize_angle_positive(double angle) {
    double const rest = std::fmod(angle, 2.0 * M_PI);
    return rest < 0 ? std::fmod(rest + 2.0 * M_PI, 2.0 * M_PI) : rest;
}
// Above -pi up to pi.
inline double normalize_angle(double angle) {
    double const positive = normalize_angle_positive(angle);
    return positive > M_PI ? positive - 2.0 * M_PI : positive;
}
inline double shortest_angular_distance(double from, double to) { return normalize_angle(to - from); }
// The same angle measured the other way round.
inline double two_pi_complement(double angle) {
    double const rest = std::fmod(angle, 2.0 * M_PI);
    return rest < 0 ? rest + 2.0 * M_PI : rest > 0 ? rest - 2.0 * M_PI : 2.0 * M_PI;
}

}  // namespace angles
