// rclcpp's timers.
#pragma once
#include <chrono>
#include <functional>
#include <memory>
#include <type_traits>
#include <utility>

#include "rclcpp/publisher.hpp"

namespace rclcpp {

struct TimerInfo {
    Time expected_call_time, actual_call_time;
};

class TimerBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(TimerBase)
    TimerBase(const node_interfaces::NodeState::SharedPtr& node, std::chrono::nanoseconds period, bool autostart,
              const CallbackGroup::SharedPtr& group, std::function<void(TimerBase&, const TimerInfo&)> callback)
        : node_(node), group_(group) {
        if (period.count() < 0) throw std::invalid_argument("timer period cannot be negative");
        auto const callable = volery::register_callable([this, callback = std::move(callback)](volery::Reader in, volery::Writer&) {
            auto const expected = in.integer();
            callback(*this, {Time(expected, RCL_ROS_TIME), Time(in.integer(), RCL_ROS_TIME)});
        });
        auto const with = volery::Writer().put(node->number()).put(period.count()).put(autostart).put(callable);
        auto const number = volery::request("ros.timer", volery::Writer(with).put(node->group(group).number())).integer();
        entity_ = std::make_unique<volery::Entity>(number, "", callable);
    }
    virtual ~TimerBase() = default;
    TimerBase(const TimerBase&) = delete;
    TimerBase& operator=(const TimerBase&) = delete;

    void cancel() { request("ros.timer_cancel"); }
    void reset() { request("ros.timer_reset"); }
    bool is_canceled() const { return request("ros.timer_canceled").flag(); }
    bool is_ready() const { return time_until_trigger().count() <= 0; }
    bool is_steady() const { return true; }
    std::chrono::nanoseconds time_until_trigger() const {
        return std::chrono::nanoseconds(request("ros.timer_left").integer());
    }

private:
    volery::Reader request(const char* what) const { return volery::request(what, volery::Writer().put(entity_->handle())); }
    node_interfaces::NodeState::SharedPtr node_;
    CallbackGroup::SharedPtr group_;
    std::unique_ptr<volery::Entity> entity_;
};

template <class Callback>
class GenericTimer : public TimerBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(GenericTimer)
    GenericTimer(const node_interfaces::NodeState::SharedPtr& node, std::chrono::nanoseconds period, Callback callback,
                 const CallbackGroup::SharedPtr& group, bool autostart)
        : TimerBase(node, period, autostart, group,
                    [callback = std::make_shared<Callback>(std::move(callback))](TimerBase& timer, const TimerInfo& info) {
                        if constexpr (std::is_invocable_v<Callback&>)
                            (*callback)();
                        else if constexpr (std::is_invocable_v<Callback&, TimerBase&>)
                            (*callback)(timer);
                        else
                            (*callback)(info);
                    }) {}
};
template <class Callback>
class WallTimer : public GenericTimer<Callback> {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(WallTimer)
    using GenericTimer<Callback>::GenericTimer;
};

}  // namespace rclcpp
