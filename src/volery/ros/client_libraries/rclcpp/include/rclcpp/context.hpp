// rclcpp::init, ok and shutdown, contexts and exceptions.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "volery/entity.h"

#define RCLCPP_SHARED_PTR_DEFINITIONS(...)                    \
    using SharedPtr = std::shared_ptr<__VA_ARGS__>;           \
    using ConstSharedPtr = std::shared_ptr<const __VA_ARGS__>; \
    template <typename... Args>                               \
    static std::shared_ptr<__VA_ARGS__> make_shared(Args&&... args) { \
        return std::make_shared<__VA_ARGS__>(std::forward<Args>(args)...); \
    }
#define RCLCPP_WEAK_PTR_DEFINITIONS(...)          \
    using WeakPtr = std::weak_ptr<__VA_ARGS__>; \
    using ConstWeakPtr = std::weak_ptr<const __VA_ARGS__>;
#define RCLCPP_UNIQUE_PTR_DEFINITIONS(...) using UniquePtr = std::unique_ptr<__VA_ARGS__>;
#define RCLCPP_SMART_PTR_DEFINITIONS(...)      \
    RCLCPP_SHARED_PTR_DEFINITIONS(__VA_ARGS__) \
    RCLCPP_WEAK_PTR_DEFINITIONS(__VA_ARGS__)   \
    RCLCPP_UNIQUE_PTR_DEFINITIONS(__VA_ARGS__)
#define RCLCPP_SMART_PTR_ALIASES_ONLY(...)          \
    using SharedPtr = std::shared_ptr<__VA_ARGS__>; \
    using WeakPtr = std::weak_ptr<__VA_ARGS__>;     \
    using UniquePtr = std::unique_ptr<__VA_ARGS__>;
#define RCLCPP_DISABLE_COPY(...)              \
    __VA_ARGS__(const __VA_ARGS__&) = delete; \
    __VA_ARGS__& operator=(const __VA_ARGS__&) = delete;
#define RCLCPP_PUBLIC
#define RCLCPP_LOCAL

namespace rclcpp {

namespace exceptions {

struct RCLError : std::runtime_error {
    using std::runtime_error::runtime_error;
};
struct UnsupportedEventTypeException : RCLError {
    using RCLError::RCLError;
};
struct RCLInvalidArgument : RCLError {
    using RCLError::RCLError;
};
struct InvalidNodeError : std::runtime_error {
    using std::runtime_error::runtime_error;
};
struct NameValidationError : std::invalid_argument {
    using std::invalid_argument::invalid_argument;
};
struct InvalidNodeNameError : NameValidationError {
    using NameValidationError::NameValidationError;
};
struct InvalidNamespaceError : NameValidationError {
    using NameValidationError::NameValidationError;
};
struct InvalidTopicNameError : NameValidationError {
    using NameValidationError::NameValidationError;
};
struct InvalidServiceNameError : NameValidationError {
    using NameValidationError::NameValidationError;
};
struct InvalidParametersException : std::runtime_error {
    using std::runtime_error::runtime_error;
};
struct InvalidParameterValueException : std::runtime_error {
    using std::runtime_error::runtime_error;
};
struct InvalidParameterTypeException : std::runtime_error {
    using std::runtime_error::runtime_error;
};
struct ParameterAlreadyDeclaredException : std::runtime_error {
    using std::runtime_error::runtime_error;
};
struct ParameterNotDeclaredException : std::runtime_error {
    using std::runtime_error::runtime_error;
};
struct ParameterImmutableException : std::runtime_error {
    using std::runtime_error::runtime_error;
};
struct ParameterUninitializedException : std::runtime_error {
    using std::runtime_error::runtime_error;
};

}  // namespace exceptions

class ContextAlreadyInitialized : public std::runtime_error {
public:
    ContextAlreadyInitialized() : std::runtime_error("context is already initialized") {}
};

namespace detail {

// Throw the exception that the graph names by its kind.
[[noreturn]] inline void raise(const std::string& kind, const std::string& text) {
    using namespace exceptions;
    if (kind == "InvalidNodeNameException") throw InvalidNodeNameError(text);
    if (kind == "InvalidNamespaceException") throw InvalidNamespaceError(text);
    if (kind == "InvalidTopicNameException") throw InvalidTopicNameError(text);
    if (kind == "InvalidServiceNameException") throw InvalidServiceNameError(text);
    if (kind == "InvalidParameterException") throw InvalidParametersException(text);
    if (kind == "InvalidParameterValueException") throw InvalidParameterValueException(text);
    if (kind == "InvalidParameterTypeException") throw InvalidParameterTypeException(text);
    if (kind == "ParameterAlreadyDeclaredException") throw ParameterAlreadyDeclaredException(text);
    if (kind == "ParameterNotDeclaredException") throw ParameterNotDeclaredException(text);
    if (kind == "ParameterImmutableException") throw ParameterImmutableException(text);
    if (kind == "ParameterUninitializedException") throw ParameterUninitializedException(text);
    if (kind == "NotInitializedException") throw RCLInvalidArgument(text);
    throw std::runtime_error(text);
}

// Make a request whose failure is one of rclcpp's exceptions.
inline volery::Reader ask(const char* name, const volery::Writer& with = {}) {
    auto answer = volery::request(name, with);
    if (!answer.flag()) {
        auto const kind = answer.text();
        raise(kind, answer.text());
    }
    return answer;
}

using volery::Entity;

inline std::vector<std::string> texts(volery::Reader answer) {
    std::vector<std::string> all(static_cast<std::size_t>(answer.integer()));
    for (auto& one : all) one = answer.text();
    return all;
}

}  // namespace detail

class InitOptions {
public:
    InitOptions& auto_initialize_logging(bool) { return *this; }
    InitOptions& set_domain_id(std::size_t) { return *this; }
    bool shutdown_on_signal = true;
};
enum class SignalHandlerOptions { All, SigInt, SigTerm, None };

// The state between init and shutdown. There is one in a component.
class Context {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(Context)
    using OnShutdownCallback = std::function<void()>;
    using OnShutdownCallbackHandle = std::size_t;

    void init(int, char const* const*, const InitOptions& = InitOptions()) {
        if (volery::request("ros.initialized").flag()) throw ContextAlreadyInitialized();
        volery::request("ros.init");
    }
    bool is_valid() const { return volery::request("ros.ok").flag(); }
    bool shutdown(const std::string& reason = "") {
        if (!is_valid()) return false;
        reason_ = reason;
        for (const auto& call : std::exchange(callbacks_, {})) call();
        volery::request("ros.shutdown");
        return true;
    }
    const std::string& shutdown_reason() const { return reason_; }
    OnShutdownCallback on_shutdown(OnShutdownCallback callback) {
        callbacks_.push_back(callback);
        return callback;
    }
    OnShutdownCallbackHandle add_on_shutdown_callback(OnShutdownCallback callback) {
        callbacks_.push_back(std::move(callback));
        return callbacks_.size() - 1;
    }
    OnShutdownCallbackHandle add_pre_shutdown_callback(OnShutdownCallback callback) {
        return add_on_shutdown_callback(std::move(callback));
    }
    std::size_t get_domain_id() const { return 0; }

private:
    std::vector<OnShutdownCallback> callbacks_;
    std::string reason_;
};

namespace contexts {

inline Context::SharedPtr get_global_default_context() {
    static auto const context = std::make_shared<Context>();
    return context;
}
using DefaultContext = Context;
namespace default_context {
using contexts::DefaultContext;
using contexts::get_global_default_context;
}  // namespace default_context

}  // namespace contexts

namespace detail {
inline Context& of(const Context::SharedPtr& context) {
    return context ? *context : *contexts::get_global_default_context();
}
}  // namespace detail

inline void init(int count, char const* const* arguments, const InitOptions& options = InitOptions(),
                 SignalHandlerOptions = SignalHandlerOptions::All) {
    detail::of(nullptr).init(count, arguments, options);
}
inline bool ok(Context::SharedPtr context = nullptr) { return detail::of(context).is_valid(); }
inline bool is_initialized(Context::SharedPtr = nullptr) { return volery::request("ros.initialized").flag(); }
inline bool shutdown(Context::SharedPtr context = nullptr, const std::string& reason = "user called rclcpp::shutdown()") {
    return detail::of(context).shutdown(reason);
}
inline void on_shutdown(std::function<void()> callback, Context::SharedPtr context = nullptr) {
    detail::of(context).on_shutdown(std::move(callback));
}
// A run ends by its own means; signals are not the component's.
inline bool install_signal_handlers(SignalHandlerOptions = SignalHandlerOptions::All) { return true; }
inline bool uninstall_signal_handlers() { return true; }
inline bool signal_handlers_installed() { return true; }

// The arguments that are not for ROS: those between --ros-args and -- are.
inline std::vector<std::string> remove_ros_arguments(int count, char const* const* arguments) {
    std::vector<std::string> left;
    bool inside = false;
    for (int index = 0; index < count; ++index) {
        std::string const one = arguments[index];
        if (one == "--ros-args")
            inside = true;
        else if (inside && one == "--")
            inside = false;
        else if (!inside)
            left.push_back(one);
    }
    return left;
}
inline std::vector<std::string> init_and_remove_ros_arguments(int count, char const* const* arguments,
                                                              const InitOptions& options = InitOptions()) {
    init(count, arguments, options);
    return remove_ros_arguments(count, arguments);
}

}  // namespace rclcpp
