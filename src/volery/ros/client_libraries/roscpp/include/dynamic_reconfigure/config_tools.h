// What the generated classes of dynamic_reconfigure have in common.
#pragma once
#include <algorithm>
#include <limits>
#include <string>

#include "dynamic_reconfigure/Config.h"
#include "dynamic_reconfigure/ConfigDescription.h"
#include "ros/ros.h"

namespace dynamic_reconfigure {

struct Parameter {
    const char *name, *type;
    std::uint32_t level;
    const char* description;
};

namespace detail {

inline auto& list(Config& message, bool) { return message.bools; }
inline auto& list(Config& message, int) { return message.ints; }
inline auto& list(Config& message, double) { return message.doubles; }
inline auto& list(Config& message, const std::string&) { return message.strs; }
template <class Value>
Value limited(Value value, Value least, Value greatest) {
    return std::min(std::max(value, least), greatest);
}
inline std::string limited(std::string value, const std::string&, const std::string&) { return value; }

}  // namespace detail

// Values of the parameters that Self::each_ visits with their limits.
template <class Self>
class ConfigBase {
public:
    static Self __getDefault__() { return Self(); }
    static Self __getMin__() { return limits(false); }
    static Self __getMax__() { return limits(true); }
    void __clamp__() {
        Self::each_([&](const Parameter&, auto member, auto least, auto greatest) {
            self().*member = detail::limited(self().*member, least, greatest);
        });
    }
    // All levels of the parameters that differ.
    std::uint32_t __level__(const Self& other) const {
        std::uint32_t level = 0;
        Self::each_([&](const Parameter& one, auto member, auto, auto) {
            if (!(self().*member == other.*member)) level |= one.level;
        });
        return level;
    }
    void __toMessage__(Config& message) const {
        message = Config();
        Self::each_([&](const Parameter& one, auto member, auto, auto) {
            auto& list = detail::list(message, self().*member);
            list.emplace_back();
            list.back().name = one.name;
            list.back().value = self().*member;
        });
        message.groups.emplace_back();
        message.groups.back().name = "Default";
        message.groups.back().state = true;
    }
    // Take the parameters that a message has.
    bool __fromMessage__(Config& message) {
        Self::each_([&](const Parameter& one, auto member, auto, auto) {
            for (const auto& given : detail::list(message, self().*member))
                if (given.name == one.name) self().*member = given.value;
        });
        return true;
    }
    void __toServer__(const ros::NodeHandle& node) const {
        Self::each_([&](const Parameter& one, auto member, auto, auto) { node.setParam(one.name, self().*member); });
    }
    void __fromServer__(const ros::NodeHandle& node) {
        Self::each_([&](const Parameter& one, auto member, auto, auto) { node.getParam(one.name, self().*member); });
    }
    static ConfigDescription __getDescriptionMessage__() {
        ConfigDescription made;
        made.groups.emplace_back();
        made.groups.back().name = "Default";
        Self::each_([&](const Parameter& one, auto, auto, auto) {
            made.groups.back().parameters.emplace_back();
            auto& described = made.groups.back().parameters.back();
            described.name = one.name;
            described.type = one.type;
            described.level = one.level;
            described.description = one.description;
        });
        __getMin__().__toMessage__(made.min);
        __getMax__().__toMessage__(made.max);
        __getDefault__().__toMessage__(made.dflt);
        return made;
    }

private:
    const Self& self() const { return static_cast<const Self&>(*this); }
    Self& self() { return static_cast<Self&>(*this); }
    static Self limits(bool upper) {
        Self made;
        Self::each_([&](const Parameter&, auto member, auto least, auto greatest) {
            made.*member = upper ? greatest : least;
        });
        return made;
    }
};

}  // namespace dynamic_reconfigure
