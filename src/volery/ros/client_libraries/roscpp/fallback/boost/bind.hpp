// Replacement of the Boost header of the same name, for machines without Boost.
#pragma once
#include <functional>

namespace boost {

using std::bind;

namespace placeholders {
using namespace std::placeholders;
}


}  // namespace boost

using namespace boost::placeholders;
