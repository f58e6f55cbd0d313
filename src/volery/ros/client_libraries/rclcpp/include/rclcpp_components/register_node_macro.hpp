// RCLCPP_COMPONENTS_REGISTER_NODE: makes the class of a node known to the main() that creates it.
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rclcpp/node.hpp"

namespace rclcpp_components {

// A node that was created, and what executors spin.
struct MadeNode {
    std::shared_ptr<void> node;
    rclcpp::node_interfaces::NodeBaseInterface::SharedPtr base;
};
using Factory = std::function<MadeNode(const rclcpp::NodeOptions&)>;

inline std::vector<std::pair<std::string, Factory>>& registered() {
    static auto* all = new std::vector<std::pair<std::string, Factory>>;
    return *all;
}

template <class NodeClass>
bool register_node(const char* name) {
    registered().emplace_back(name, [](const rclcpp::NodeOptions& options) {
        auto const node = std::make_shared<NodeClass>(options);
        return MadeNode{node, node->get_node_base_interface()};
    });
    return true;
}

}  // namespace rclcpp_components

#define VOLERY_JOINED_(a, b) a##b
#define VOLERY_JOINED(a, b) VOLERY_JOINED_(a, b)
#define RCLCPP_COMPONENTS_REGISTER_NODE(...)                                                 \
    namespace {                                                                              \
    [[maybe_unused]] bool const VOLERY_JOINED(volery_registered_, __COUNTER__) =             \
        rclcpp_components::register_node<__VA_ARGS__>(#__VA_ARGS__);                         \
    }
