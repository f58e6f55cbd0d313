// Replacement of the Boost header of the same name, for machines without Boost.
#pragma once
#include <array>

namespace boost {

using std::array;

}  // namespace boost
