// In place of Boost's header where Boost is not installed.
#pragma once
#include <memory>

namespace boost {

using std::make_shared;

}  // namespace boost
