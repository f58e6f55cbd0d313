// Functions to join the graph, spin and leave the graph.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "ros/names.h"
#include "ros/spinner.h"

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
// Arguments for ROS (``a:=b``) are removed from the others; the launch settings contain them already.
inline void init(int& count, char** arguments, const std::string& name, std::uint32_t options = 0) {
    init(M_string(), name, options);
    int kept = 0;
    for (int index = 0; index < count; ++index)
        if (std::string(arguments[index]).find(":=") == std::string::npos) arguments[kept++] = arguments[index];
    if (kept < count) arguments[kept] = nullptr;
    count = kept;
}

inline bool isInitialized() { return volery::request("ros.initialized").flag(); }
inline bool isStarted() { return isInitialized(); }
inline void start() { volery::request("ros.ok"); }
inline bool ok() { return volery::request("ros.ok").flag(); }
inline bool isShuttingDown() { return !ok(); }
inline void shutdown() { volery::request("ros.shutdown"); }
inline void requestShutdown() { shutdown(); }
inline void waitForShutdown() { volery::request("ros.wait_for_shutdown"); }

inline void removeROSArgs(int count, const char* const* arguments, std::vector<std::string>& left) {
    left.clear();
    for (int index = 0; index < count; ++index)
        if (std::string(arguments[index]).find(":=") == std::string::npos) left.emplace_back(arguments[index]);
}

namespace master {
inline bool check() { return true; }
inline bool getNodes(V_string& nodes) {
    auto answer = volery::request("ros.nodes");
    nodes.resize(static_cast<std::size_t>(answer.integer()));
    for (auto& node : nodes) node = answer.text();
    return true;
}
}  // namespace master

}  // namespace ros
