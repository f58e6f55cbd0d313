// Plain types of a model's interfaces.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

namespace volery {

// The surface that an altitude is measured from.
enum class Reference { amsl, ellipsoid, home, ground };

// A point: WGS-84 degrees, north and east positive, and metres above the reference surface.
struct Position {
    double latitude = 0.0;
    double longitude = 0.0;
    double altitude = 0.0;
    Reference reference = Reference::amsl;
};

}  // namespace volery

using volery::Position;
