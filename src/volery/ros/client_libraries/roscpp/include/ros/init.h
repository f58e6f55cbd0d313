// Functions to join the graph, spin and leave the graph.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "ros/names.h"

namespace ros {

namespace init_options {
enum InitOption : std::uint32_t { NoSigintHandler = 1, AnonymousName = 2, NoRosout = 4 };
}
using InitOption = init_options::InitOption;

// As in a launch file, the name of the component names the node, whatever name is given here.
inline void init(const M_string&, const std::string& name, std::uint32_t options = 0) {
    bool const anonymous = (options & init_options::AnonymousName) != 0;
    volery::request("ros.init", volery::Writer().put(name).put(anonymous));
}
inline void init(int&, char**, const std::string& name, std::uint32_t options = 0) {
    init(M_string(), name, options);
}

inline bool isInitialized() { return volery::request("ros.initialized").flag(); }
inline bool isStarted() { return isInitialized(); }
inline void start() { volery::request("ros.ok"); }
inline bool ok() { return volery::request("ros.ok").flag(); }
inline bool isShuttingDown() { return !ok(); }
inline void shutdown() { volery::request("ros.shutdown"); }
inline void requestShutdown() { shutdown(); }
inline void waitForShutdown() { volery::request("ros.wait_for_shutdown"); }

// Run the callbacks that are ready.
inline void spinOnce() { volery::request("ros.spin_once"); }
// Run callbacks as they become ready, until the node shuts down.
inline void spin() { volery::request("ros.spin"); }

class SingleThreadedSpinner {
public:
    void spin() { ros::spin(); }
};
template <class Spinner>
void spin(Spinner& spinner) {
    spinner.spin();
}

#define VOLERY_REFUSED(what) __attribute__((error("volery: " what)))

// A component has one flow of control, so spinners with threads of their own are refused.
class AsyncSpinner {
public:
    VOLERY_REFUSED("ros::AsyncSpinner is not offered: a component has one flow of control; call ros::spin() or "
                   "ros::spinOnce(), or make it two components")
    explicit AsyncSpinner(std::uint32_t threads);
    void start();
    void stop();
};
class MultiThreadedSpinner {
public:
    VOLERY_REFUSED("ros::MultiThreadedSpinner is not offered: a component has one flow of control; call ros::spin()")
    explicit MultiThreadedSpinner(std::uint32_t threads = 0);
    void spin();
};

inline void removeROSArgs(int count, const char* const* arguments, std::vector<std::string>& left) {
    left.clear();
    for (int index = 0; index < count; ++index)
        if (std::string(arguments[index]).find(":=") == std::string::npos) left.emplace_back(arguments[index]);
}

namespace master {
inline bool check() { return true; }
}  // namespace master

}  // namespace ros
