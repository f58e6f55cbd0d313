// Replacement of the Boost header of the same name, for machines without Boost.
#pragma once
#include <memory>

namespace boost {

using std::const_pointer_cast;
using std::dynamic_pointer_cast;
using std::shared_ptr;
using std::static_pointer_cast;

}  // namespace boost
