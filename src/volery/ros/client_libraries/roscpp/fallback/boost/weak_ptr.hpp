// Replacement of the Boost header of the same name, for machines without Boost.
#pragma once
#include <memory>

namespace boost {

using std::weak_ptr;

}  // namespace boost
