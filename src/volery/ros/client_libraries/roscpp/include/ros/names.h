// Resolution of graph names, and the name of this node.
#pragma once
#include <map>
#include <set>
#include <string>
#include <vector>

#include "ros/time.h"

namespace ros {

using M_string = std::map<std::string, std::string>;
using V_string = std::vector<std::string>;
using S_string = std::set<std::string>;

class InvalidNameException : public Exception {
public:
    using Exception::Exception;
};

namespace names {

inline std::string resolve(const std::string& ns, const std::string& name, bool = true) {
    return volery::request("ros.resolve", volery::Writer().put(ns).put(name)).text();
}
inline std::string resolve(const std::string& name, bool remap = true) { return resolve("", name, remap); }
inline std::string clean(const std::string& name) {
    std::string cleaned;
    for (char const letter : name)
        if (letter != '/' || cleaned.empty() || cleaned.back() != '/') cleaned += letter;
    if (cleaned.size() > 1 && cleaned.back() == '/') cleaned.pop_back();
    return cleaned;
}
inline std::string append(const std::string& left, const std::string& right) { return clean(left + "/" + right); }

}  // namespace names

namespace this_node {

inline std::string getName() { return volery::request("ros.name").text(); }
inline std::string getNamespace() { return volery::request("ros.namespace").text(); }

}  // namespace this_node
}  // namespace ros
