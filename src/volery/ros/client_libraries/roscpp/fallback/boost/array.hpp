// In place of Boost's header where Boost is not installed.
#pragma once
#include <array>

namespace boost {

using std::array;

}  // namespace boost
