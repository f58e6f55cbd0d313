// In place of Boost's header where Boost is not installed.
#pragma once
#include <memory>

namespace boost {

using std::weak_ptr;

}  // namespace boost
