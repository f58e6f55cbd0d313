// diagnostic_updater: a node's tasks that say how it is, published on /diagnostics once a period.
#pragma once
#include <cstdarg>
#include <cstdio>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "diagnostic_msgs/msg/diagnostic_array.hpp"
#include "diagnostic_msgs/msg/diagnostic_status.hpp"
#include "rclcpp/node.hpp"

namespace diagnostic_updater {

class DiagnosticStatusWrapper : public diagnostic_msgs::msg::DiagnosticStatus {
public:
    void summary(unsigned char with_level, const std::string& text) {
        level = with_level;
        message = text;
    }
    void summary(const diagnostic_msgs::msg::DiagnosticStatus& from) { summary(from.level, from.message); }
    void summaryf(unsigned char with_level, const char* format, ...) {
        va_list list;
        va_start(list, format);
        summary(with_level, formatted(format, list));
        va_end(list);
    }
    void clearSummary() { summary(OK, ""); }
    // The worse level, and the messages of both if both are as bad.
    void mergeSummary(unsigned char with_level, const std::string& text) {
        if ((with_level > OK) == (level > OK))
            message += (message.empty() ? "" : "; ") + text;
        else if (with_level > level)
            message = text;
        if (with_level > level) level = with_level;
    }
    void mergeSummary(const diagnostic_msgs::msg::DiagnosticStatus& from) { mergeSummary(from.level, from.message); }
    void mergeSummaryf(unsigned char with_level, const char* format, ...) {
        va_list list;
        va_start(list, format);
        mergeSummary(with_level, formatted(format, list));
        va_end(list);
    }
    template <class Value>
    void add(const std::string& key, const Value& value) {
        std::ostringstream text;
        if constexpr (std::is_same_v<Value, bool>)
            text << (value ? "True" : "False");
        else
            text << value;
        values.emplace_back();
        values.back().key = key;
        values.back().value = text.str();
    }
    void addf(const std::string& key, const char* format, ...) {
        va_list list;
        va_start(list, format);
        add(key, formatted(format, list));
        va_end(list);
    }
    void clear() { values.clear(); }

private:
    static std::string formatted(const char* format, va_list list) {
        char text[1000];
        std::vsnprintf(text, sizeof text, format, list);
        return text;
    }
};

using TaskFunction = std::function<void(DiagnosticStatusWrapper&)>;

class DiagnosticTask {
public:
    explicit DiagnosticTask(std::string name) : name_(std::move(name)) {}
    virtual ~DiagnosticTask() = default;
    const std::string& getName() const { return name_; }
    virtual void run(DiagnosticStatusWrapper& status) = 0;

private:
    std::string name_;
};

template <class Type>
class GenericFunctionDiagnosticTask : public DiagnosticTask {
public:
    GenericFunctionDiagnosticTask(const std::string& name, std::function<void(Type&)> function)
        : DiagnosticTask(name), function_(std::move(function)) {}
    void run(DiagnosticStatusWrapper& status) override { function_(status); }

private:
    std::function<void(Type&)> function_;
};
using FunctionDiagnosticTask = GenericFunctionDiagnosticTask<DiagnosticStatusWrapper>;

// Several tasks with one status.
class CompositeDiagnosticTask : public DiagnosticTask {
public:
    using DiagnosticTask::DiagnosticTask;
    void addTask(DiagnosticTask* task) { tasks_.push_back(task); }
    void run(DiagnosticStatusWrapper& status) override {
        DiagnosticStatusWrapper merged;
        for (auto* task : tasks_) {
            auto one = status;
            one.clearSummary();
            task->run(one);
            merged.mergeSummary(one);
            status.values = one.values;
        }
        status.summary(merged);
    }

private:
    std::vector<DiagnosticTask*> tasks_;
};

class Updater {
public:
    // Of a node, or a pointer to one.
    template <class NodeType>
    explicit Updater(NodeType&& node, double period = 1.0)
        : state_(rclcpp::detail::state_of(node)),
          publisher_(rclcpp::create_publisher<diagnostic_msgs::msg::DiagnosticArray>(state_, "/diagnostics", 1)) {
        if (!node->has_parameter("diagnostic_updater.period")) node->declare_parameter("diagnostic_updater.period", period);
        setPeriod(node->get_parameter("diagnostic_updater.period").as_double());
    }
    Updater(const Updater&) = delete;
    Updater& operator=(const Updater&) = delete;

    void add(const std::string& name, TaskFunction function) {
        tasks_.emplace_back(name, std::move(function));
        DiagnosticStatusWrapper status;
        status.name = name;
        status.summary(DiagnosticStatusWrapper::OK, "Node starting up");
        publish({status});
    }
    void add(DiagnosticTask& task) {
        add(task.getName(), [&task](DiagnosticStatusWrapper& status) { task.run(status); });
    }
    template <class Class>
    void add(const std::string& name, Class* object, void (Class::*function)(DiagnosticStatusWrapper&)) {
        add(name, [=](DiagnosticStatusWrapper& status) { (object->*function)(status); });
    }
    bool removeByName(const std::string& name) {
        for (auto task = tasks_.begin(); task != tasks_.end(); ++task)
            if (task->first == name) return tasks_.erase(task), true;
        return false;
    }
    rclcpp::Duration getPeriod() const { return period_; }
    void setPeriod(rclcpp::Duration period) {
        period_ = period;
        auto const span = std::chrono::nanoseconds(period.nanoseconds());
        timer_ = rclcpp::create_wall_timer(span, std::function<void()>([this] { update(); }), nullptr, state_, state_);
    }
    void setPeriod(double seconds) { setPeriod(rclcpp::Duration::from_seconds(seconds)); }
    void force_update() { update(); }
    // One status of all tasks.
    void broadcast(unsigned char level, const std::string& message) {
        std::vector<diagnostic_msgs::msg::DiagnosticStatus> all;
        for (const auto& task : tasks_) {
            DiagnosticStatusWrapper status;
            status.name = task.first;
            status.summary(level, message);
            all.push_back(status);
        }
        publish(all);
    }
    void setHardwareID(const std::string& hardware) { hardware_ = hardware; }
    void setHardwareIDf(const char* format, ...) {
        char text[1000];
        va_list list;
        va_start(list, format);
        std::vsnprintf(text, sizeof text, format, list);
        va_end(list);
        hardware_ = text;
    }

private:
    void update() {
        std::vector<diagnostic_msgs::msg::DiagnosticStatus> all;
        for (const auto& task : tasks_) {
            DiagnosticStatusWrapper status;
            status.name = task.first;
            status.summary(DiagnosticStatusWrapper::ERROR, "No message was set");
            status.hardware_id = hardware_;
            task.second(status);
            all.push_back(status);
        }
        publish(all);
    }
    void publish(std::vector<diagnostic_msgs::msg::DiagnosticStatus> all) {
        diagnostic_msgs::msg::DiagnosticArray message;
        for (auto& one : all) one.name = std::string(state_->get_name()) + ": " + one.name;
        message.header.stamp = rclcpp::Time(volery::request("ros.now").integer(), RCL_ROS_TIME);
        message.status = std::move(all);
        publisher_->publish(message);
    }
    rclcpp::node_interfaces::NodeState::SharedPtr state_;
    rclcpp::Publisher<diagnostic_msgs::msg::DiagnosticArray>::SharedPtr publisher_;
    rclcpp::TimerBase::SharedPtr timer_;
    rclcpp::Duration period_{1, 0};
    std::string hardware_;
    std::vector<std::pair<std::string, TaskFunction>> tasks_;
};

}  // namespace diagnostic_updater
