// In place of Boost's header where Boost is not installed.
#pragma once
#include <functional>

namespace boost {

using std::bind;

namespace placeholders {
using namespace std::placeholders;
}


}  // namespace boost

using namespace boost::placeholders;
