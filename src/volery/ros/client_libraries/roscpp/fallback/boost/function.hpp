// Replacement of the Boost header of the same name, for machines without Boost.
#pragma once
#include <functional>

namespace boost {

using std::function;

}  // namespace boost
