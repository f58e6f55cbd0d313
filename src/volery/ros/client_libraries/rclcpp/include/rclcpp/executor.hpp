// rclcpp's executors and rclcpp::spin. The threads of an executor are tasks of the run, which change at calls of
// ROS only.
#pragma once
#include <chrono>
#include <cstdint>
#include <future>
#include <memory>
#include <ostream>
#include <string>

#include "rclcpp/publisher.hpp"

namespace rclcpp {

class Node;

enum class FutureReturnCode { SUCCESS, INTERRUPTED, TIMEOUT };
inline std::string to_string(FutureReturnCode code) {
    static const char* const NAMES[] = {"SUCCESS (0)", "INTERRUPTED (1)", "TIMEOUT (2)"};
    return NAMES[static_cast<int>(code)];
}
inline std::ostream& operator<<(std::ostream& out, FutureReturnCode code) { return out << to_string(code); }

struct ExecutorOptions {
    Context::SharedPtr context;
};

class Executor {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(Executor)
    using NodePtr = node_interfaces::NodeBaseInterface::SharedPtr;

    explicit Executor(const ExecutorOptions& = ExecutorOptions()) : number_(volery::request("ros.executor").integer()) {}
    Executor(const Executor&) = delete;
    Executor& operator=(const Executor&) = delete;
    virtual ~Executor() { volery::try_request("ros.close", volery::Writer().put(number_)); }

    virtual void add_node(NodePtr node, bool = true) { change("ros.executor_add", node->number()); }
    virtual void add_node(std::shared_ptr<Node> node, bool notify = true);
    virtual void remove_node(NodePtr node, bool = true) { change("ros.executor_remove", node->number()); }
    virtual void remove_node(std::shared_ptr<Node> node, bool notify = true);
    virtual void add_callback_group(CallbackGroup::SharedPtr group, NodePtr, bool = true) {
        change("ros.executor_add_group", group->number());
    }
    virtual void remove_callback_group(CallbackGroup::SharedPtr group, bool = true) {
        change("ros.executor_remove_group", group->number());
    }

    // Run callbacks until the context is shut down or the executor is cancelled.
    virtual void spin() { detail::ask("ros.executor_spin", about()); }
    // Run the next callback; a negative time-out means none.
    virtual void spin_once(std::chrono::nanoseconds timeout = std::chrono::nanoseconds(-1)) {
        detail::ask("ros.executor_spin_once", about().put(timeout.count()));
    }
    // Run the callbacks that are ready.
    virtual void spin_some(std::chrono::nanoseconds longest = std::chrono::nanoseconds(0)) { spin_ready(longest, false); }
    // Run callbacks until none is ready.
    virtual void spin_all(std::chrono::nanoseconds longest) {
        if (longest.count() < 0) throw std::invalid_argument("max_duration must be greater than or equal to 0");
        spin_ready(longest, true);
    }
    void spin_node_once(NodePtr node, std::chrono::nanoseconds timeout = std::chrono::nanoseconds(-1)) {
        add_node(node);
        spin_once(timeout);
        remove_node(node);
    }
    void spin_node_some(NodePtr node) {
        add_node(node);
        spin_some();
        remove_node(node);
    }
    template <class Future, class Rep = std::int64_t, class Period = std::milli>
    FutureReturnCode spin_until_future_complete(
        const Future& future, std::chrono::duration<Rep, Period> timeout = std::chrono::duration<Rep, Period>(-1)) {
        auto const within = std::chrono::duration_cast<std::chrono::nanoseconds>(timeout).count();
        auto const end = now() + within;
        while (true) {
            if (future.wait_for(std::chrono::seconds(0)) == std::future_status::ready) return FutureReturnCode::SUCCESS;
            if (!ok() || cancelled_) return cancelled_ = false, FutureReturnCode::INTERRUPTED;
            auto const left = within < 0 ? -1 : end - now();
            if (within >= 0 && left <= 0) return FutureReturnCode::TIMEOUT;
            spin_once(std::chrono::nanoseconds(left));
        }
    }
    virtual void cancel() {
        cancelled_ = true;
        volery::request("ros.executor_cancel", about());
    }
    bool is_spinning() const { return volery::request("ros.executor_spinning", about()).flag(); }

protected:
    volery::Writer about() const { return volery::Writer().put(number_); }
    std::int64_t number_;

private:
    static std::int64_t now() { return volery::request("ros.now").integer(); }
    void change(const char* how, std::int64_t what) { detail::ask(how, about().put(what)); }
    void spin_ready(std::chrono::nanoseconds longest, bool all) {
        detail::ask("ros.executor_spin_ready", about().put(longest.count()).put(all));
    }
    bool cancelled_ = false;
};

namespace executors {

class SingleThreadedExecutor : public Executor {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(SingleThreadedExecutor)
    using Executor::Executor;
};
class StaticSingleThreadedExecutor : public Executor {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(StaticSingleThreadedExecutor)
    using Executor::Executor;
};
class MultiThreadedExecutor : public Executor {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(MultiThreadedExecutor)
    explicit MultiThreadedExecutor(const ExecutorOptions& options = ExecutorOptions(), std::size_t threads = 0,
                                   bool = false, std::chrono::nanoseconds = std::chrono::nanoseconds(-1))
        : Executor(options), threads_(threads == 0 ? CORES : threads) {}
    std::size_t get_number_of_threads() const { return threads_; }
    void spin() override {
        auto const callable = volery::register_callable([number = number_](volery::Reader, volery::Writer&) {
            volery::request("ros.executor_help", volery::Writer().put(number));
        });
        for (std::size_t thread = 1; thread < threads_; ++thread)
            volery::request("ros.spawn", volery::Writer().put(callable).put("executor"));
        Executor::spin();
    }

private:
    static constexpr std::size_t CORES = 4;  // of a computer on board, whatever this machine has
    std::size_t threads_;
};

}  // namespace executors

namespace experimental::executors {
using EventsExecutor = rclcpp::executors::SingleThreadedExecutor;
}  // namespace experimental::executors
namespace executor {
using rclcpp::FutureReturnCode;
}  // namespace executor

inline void spin(node_interfaces::NodeBaseInterface::SharedPtr node) {
    executors::SingleThreadedExecutor executor;
    executor.add_node(node);
    executor.spin();
    executor.remove_node(node);
}
inline void spin_some(node_interfaces::NodeBaseInterface::SharedPtr node) {
    executors::SingleThreadedExecutor().spin_node_some(node);
}
inline void spin_all(node_interfaces::NodeBaseInterface::SharedPtr node, std::chrono::nanoseconds longest) {
    executors::SingleThreadedExecutor executor;
    executor.add_node(node);
    executor.spin_all(longest);
    executor.remove_node(node);
}
void spin(std::shared_ptr<Node> node);
void spin_some(std::shared_ptr<Node> node);
void spin_all(std::shared_ptr<Node> node, std::chrono::nanoseconds longest);

namespace executors {

template <class Future, class Rep = std::int64_t, class Period = std::milli>
FutureReturnCode spin_node_until_future_complete(
    Executor& executor, node_interfaces::NodeBaseInterface::SharedPtr node, const Future& future,
    std::chrono::duration<Rep, Period> timeout = std::chrono::duration<Rep, Period>(-1)) {
    executor.add_node(node);
    auto const code = executor.spin_until_future_complete(future, timeout);
    executor.remove_node(node);
    return code;
}

}  // namespace executors

template <class Future, class Rep = std::int64_t, class Period = std::milli>
FutureReturnCode spin_until_future_complete(
    node_interfaces::NodeBaseInterface::SharedPtr node, const Future& future,
    std::chrono::duration<Rep, Period> timeout = std::chrono::duration<Rep, Period>(-1)) {
    executors::SingleThreadedExecutor executor;
    return executors::spin_node_until_future_complete(executor, node, future, timeout);
}
template <class NodeType, class Future, class Rep = std::int64_t, class Period = std::milli>
auto spin_until_future_complete(std::shared_ptr<NodeType> node, const Future& future,
                                std::chrono::duration<Rep, Period> timeout = std::chrono::duration<Rep, Period>(-1))
    -> decltype(node->get_node_base_interface(), FutureReturnCode()) {
    return spin_until_future_complete(node->get_node_base_interface(), future, timeout);
}

}  // namespace rclcpp
