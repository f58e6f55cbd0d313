// rclcpp::QoS: qualities of service and their presets.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "rclcpp/time.hpp"

enum rmw_qos_history_policy_t {
    RMW_QOS_POLICY_HISTORY_SYSTEM_DEFAULT,
    RMW_QOS_POLICY_HISTORY_KEEP_LAST,
    RMW_QOS_POLICY_HISTORY_KEEP_ALL,
    RMW_QOS_POLICY_HISTORY_UNKNOWN
};
enum rmw_qos_reliability_policy_t {
    RMW_QOS_POLICY_RELIABILITY_SYSTEM_DEFAULT,
    RMW_QOS_POLICY_RELIABILITY_RELIABLE,
    RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT,
    RMW_QOS_POLICY_RELIABILITY_UNKNOWN,
    RMW_QOS_POLICY_RELIABILITY_BEST_AVAILABLE
};
enum rmw_qos_durability_policy_t {
    RMW_QOS_POLICY_DURABILITY_SYSTEM_DEFAULT,
    RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL,
    RMW_QOS_POLICY_DURABILITY_VOLATILE,
    RMW_QOS_POLICY_DURABILITY_UNKNOWN,
    RMW_QOS_POLICY_DURABILITY_BEST_AVAILABLE
};
enum rmw_qos_liveliness_policy_t {
    RMW_QOS_POLICY_LIVELINESS_SYSTEM_DEFAULT = 0,
    RMW_QOS_POLICY_LIVELINESS_AUTOMATIC = 1,
    RMW_QOS_POLICY_LIVELINESS_MANUAL_BY_TOPIC = 3,
    RMW_QOS_POLICY_LIVELINESS_UNKNOWN = 4,
    RMW_QOS_POLICY_LIVELINESS_BEST_AVAILABLE = 5
};
enum rmw_qos_policy_kind_t {
    RMW_QOS_POLICY_INVALID = 1,
    RMW_QOS_POLICY_DURABILITY = 2,
    RMW_QOS_POLICY_DEADLINE = 4,
    RMW_QOS_POLICY_LIVELINESS = 8,
    RMW_QOS_POLICY_RELIABILITY = 16,
    RMW_QOS_POLICY_HISTORY = 32,
    RMW_QOS_POLICY_LIFESPAN = 64
};
struct rmw_qos_profile_t {
    rmw_qos_history_policy_t history;
    std::size_t depth;
    rmw_qos_reliability_policy_t reliability;
    rmw_qos_durability_policy_t durability;
    rmw_time_t deadline;
    rmw_time_t lifespan;
    rmw_qos_liveliness_policy_t liveliness;
    rmw_time_t liveliness_lease_duration;
    bool avoid_ros_namespace_conventions;
};
using rmw_qos_profile_s = rmw_qos_profile_t;

namespace rclcpp {
namespace detail {

constexpr rmw_qos_profile_t profile(std::size_t depth, rmw_qos_reliability_policy_t reliability,
                                    rmw_qos_durability_policy_t durability,
                                    rmw_qos_history_policy_t history = RMW_QOS_POLICY_HISTORY_KEEP_LAST) {
    return {history, depth, reliability, durability, {0, 0}, {0, 0}, RMW_QOS_POLICY_LIVELINESS_SYSTEM_DEFAULT, {0, 0}, false};
}

}  // namespace detail
}  // namespace rclcpp

static constexpr rmw_qos_profile_t rmw_qos_profile_default =
    rclcpp::detail::profile(10, RMW_QOS_POLICY_RELIABILITY_RELIABLE, RMW_QOS_POLICY_DURABILITY_VOLATILE);
static constexpr rmw_qos_profile_t rmw_qos_profile_services_default = rmw_qos_profile_default;
static constexpr rmw_qos_profile_t rmw_qos_profile_sensor_data =
    rclcpp::detail::profile(5, RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT, RMW_QOS_POLICY_DURABILITY_VOLATILE);
static constexpr rmw_qos_profile_t rmw_qos_profile_parameters =
    rclcpp::detail::profile(1000, RMW_QOS_POLICY_RELIABILITY_RELIABLE, RMW_QOS_POLICY_DURABILITY_VOLATILE);
static constexpr rmw_qos_profile_t rmw_qos_profile_parameter_events = rmw_qos_profile_parameters;
static constexpr rmw_qos_profile_t rmw_qos_profile_rosout_default =
    rclcpp::detail::profile(1000, RMW_QOS_POLICY_RELIABILITY_RELIABLE, RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL);
static constexpr rmw_qos_profile_t rmw_qos_profile_system_default =
    rclcpp::detail::profile(0, RMW_QOS_POLICY_RELIABILITY_SYSTEM_DEFAULT, RMW_QOS_POLICY_DURABILITY_SYSTEM_DEFAULT,
                            RMW_QOS_POLICY_HISTORY_SYSTEM_DEFAULT);
static constexpr rmw_qos_profile_t rmw_qos_profile_best_available =
    rclcpp::detail::profile(10, RMW_QOS_POLICY_RELIABILITY_BEST_AVAILABLE, RMW_QOS_POLICY_DURABILITY_BEST_AVAILABLE);
static constexpr rmw_qos_profile_t rmw_qos_profile_action_status_default =
    rclcpp::detail::profile(1, RMW_QOS_POLICY_RELIABILITY_RELIABLE, RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL);
static constexpr rmw_qos_profile_t rcl_action_qos_profile_status_default = rmw_qos_profile_action_status_default;

namespace rclcpp {

inline std::string qos_policy_name_from_kind(rmw_qos_policy_kind_t kind) {
    switch (kind) {
        case RMW_QOS_POLICY_DURABILITY: return "DURABILITY_QOS_POLICY";
        case RMW_QOS_POLICY_DEADLINE: return "DEADLINE_QOS_POLICY";
        case RMW_QOS_POLICY_LIVELINESS: return "LIVELINESS_QOS_POLICY";
        case RMW_QOS_POLICY_RELIABILITY: return "RELIABILITY_QOS_POLICY";
        case RMW_QOS_POLICY_HISTORY: return "HISTORY_QOS_POLICY";
        case RMW_QOS_POLICY_LIFESPAN: return "LIFESPAN_QOS_POLICY";
        default: return "INVALID_QOS_POLICY";
    }
}

enum class HistoryPolicy { KeepLast = 1, KeepAll = 2, SystemDefault = 0, Unknown = 3 };
enum class ReliabilityPolicy { BestEffort = 2, Reliable = 1, SystemDefault = 0, Unknown = 3, BestAvailable = 4 };
enum class DurabilityPolicy { Volatile = 2, TransientLocal = 1, SystemDefault = 0, Unknown = 3, BestAvailable = 4 };
enum class LivelinessPolicy { Automatic = 1, ManualByTopic = 3, SystemDefault = 0, Unknown = 4, BestAvailable = 5 };

struct QoSInitialization {
    QoSInitialization(rmw_qos_history_policy_t policy, std::size_t count, bool = false)
        : history_policy(policy), depth(count) {}
    static QoSInitialization from_rmw(const rmw_qos_profile_t& profile) { return {profile.history, profile.depth}; }
    rmw_qos_history_policy_t history_policy;
    std::size_t depth;
};
struct KeepAll : QoSInitialization {
    KeepAll() : QoSInitialization(RMW_QOS_POLICY_HISTORY_KEEP_ALL, 0) {}
};
struct KeepLast : QoSInitialization {
    explicit KeepLast(std::size_t depth, bool = true) : QoSInitialization(RMW_QOS_POLICY_HISTORY_KEEP_LAST, depth) {}
};

class QoS {
public:
    explicit QoS(const QoSInitialization& initialization, const rmw_qos_profile_t& profile = rmw_qos_profile_default)
        : profile_(profile) {
        profile_.history = initialization.history_policy;
        profile_.depth = initialization.depth;
    }
    QoS(std::size_t depth) : QoS(KeepLast(depth)) {}

    QoS& history(HistoryPolicy policy) { return profile_.history = static_cast<rmw_qos_history_policy_t>(policy), *this; }
    QoS& history(rmw_qos_history_policy_t policy) { return profile_.history = policy, *this; }
    QoS& keep_last(std::size_t depth) { return profile_.depth = depth, history(HistoryPolicy::KeepLast); }
    QoS& keep_all() { return profile_.depth = 0, history(HistoryPolicy::KeepAll); }
    QoS& reliability(ReliabilityPolicy policy) {
        return profile_.reliability = static_cast<rmw_qos_reliability_policy_t>(policy), *this;
    }
    QoS& reliability(rmw_qos_reliability_policy_t policy) { return profile_.reliability = policy, *this; }
    QoS& reliable() { return reliability(ReliabilityPolicy::Reliable); }
    QoS& best_effort() { return reliability(ReliabilityPolicy::BestEffort); }
    QoS& reliability_best_available() { return reliability(ReliabilityPolicy::BestAvailable); }
    QoS& durability(DurabilityPolicy policy) {
        return profile_.durability = static_cast<rmw_qos_durability_policy_t>(policy), *this;
    }
    QoS& durability(rmw_qos_durability_policy_t policy) { return profile_.durability = policy, *this; }
    QoS& durability_volatile() { return durability(DurabilityPolicy::Volatile); }
    QoS& transient_local() { return durability(DurabilityPolicy::TransientLocal); }
    QoS& durability_best_available() { return durability(DurabilityPolicy::BestAvailable); }
    QoS& deadline(rmw_time_t span) { return profile_.deadline = span, *this; }
    QoS& deadline(const Duration& span) { return deadline(span.to_rmw_time()); }
    QoS& lifespan(rmw_time_t span) { return profile_.lifespan = span, *this; }
    QoS& lifespan(const Duration& span) { return lifespan(span.to_rmw_time()); }
    QoS& liveliness(LivelinessPolicy policy) {
        return profile_.liveliness = static_cast<rmw_qos_liveliness_policy_t>(policy), *this;
    }
    QoS& liveliness(rmw_qos_liveliness_policy_t policy) { return profile_.liveliness = policy, *this; }
    QoS& liveliness_lease_duration(rmw_time_t span) { return profile_.liveliness_lease_duration = span, *this; }
    QoS& liveliness_lease_duration(const Duration& span) { return liveliness_lease_duration(span.to_rmw_time()); }
    QoS& avoid_ros_namespace_conventions(bool avoid) { return profile_.avoid_ros_namespace_conventions = avoid, *this; }

    HistoryPolicy history() const { return static_cast<HistoryPolicy>(profile_.history); }
    std::size_t depth() const { return profile_.depth; }
    ReliabilityPolicy reliability() const { return static_cast<ReliabilityPolicy>(profile_.reliability); }
    DurabilityPolicy durability() const { return static_cast<DurabilityPolicy>(profile_.durability); }
    Duration deadline() const { return Duration::from_rmw_time(profile_.deadline); }
    Duration lifespan() const { return Duration::from_rmw_time(profile_.lifespan); }
    LivelinessPolicy liveliness() const { return static_cast<LivelinessPolicy>(profile_.liveliness); }
    Duration liveliness_lease_duration() const { return Duration::from_rmw_time(profile_.liveliness_lease_duration); }
    bool avoid_ros_namespace_conventions() const { return profile_.avoid_ros_namespace_conventions; }
    const rmw_qos_profile_t& get_rmw_qos_profile() const { return profile_; }
    rmw_qos_profile_t& get_rmw_qos_profile() { return profile_; }

private:
    rmw_qos_profile_t profile_;
};

#define VOLERY_QOS(name, preset)                                                               \
    class name : public QoS {                                                                  \
    public:                                                                                    \
        explicit name(const QoSInitialization& first = QoSInitialization::from_rmw(preset)) \
            : QoS(first, preset) {}                                                            \
    };
VOLERY_QOS(SensorDataQoS, rmw_qos_profile_sensor_data)
VOLERY_QOS(ParametersQoS, rmw_qos_profile_parameters)
VOLERY_QOS(ServicesQoS, rmw_qos_profile_services_default)
VOLERY_QOS(ParameterEventsQoS, rmw_qos_profile_parameter_events)
VOLERY_QOS(RosoutQoS, rmw_qos_profile_rosout_default)
VOLERY_QOS(SystemDefaultsQoS, rmw_qos_profile_system_default)
VOLERY_QOS(BestAvailableQoS, rmw_qos_profile_best_available)
#undef VOLERY_QOS
class ClockQoS : public QoS {
public:
    explicit ClockQoS(const QoSInitialization& first = KeepLast(1)) : QoS(first) { best_effort(); }
};

namespace detail {

inline void put(volery::Writer& out, const QoS& qos) {
    const auto& profile = qos.get_rmw_qos_profile();
    out.put(static_cast<int>(profile.history)).put(profile.depth).put(static_cast<int>(profile.reliability));
    out.put(static_cast<int>(profile.durability)).put(static_cast<int>(profile.liveliness));
    for (const auto& span : {qos.deadline(), qos.lifespan(), qos.liveliness_lease_duration()}) out.put(span.nanoseconds());
}

}  // namespace detail
}  // namespace rclcpp
