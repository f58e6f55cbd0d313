// rclcpp::Parameter and ParameterValue.
#pragma once
#include <cstdint>
#include <ostream>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "rcl_interfaces/msg/list_parameters_result.hpp"
#include "rcl_interfaces/msg/parameter.hpp"
#include "rcl_interfaces/msg/parameter_descriptor.hpp"
#include "rcl_interfaces/msg/parameter_event.hpp"
#include "rcl_interfaces/msg/parameter_type.hpp"
#include "rcl_interfaces/msg/parameter_value.hpp"
#include "rcl_interfaces/msg/set_parameters_result.hpp"
#include "rclcpp/context.hpp"

namespace rclcpp {

enum ParameterType : std::uint8_t {
    PARAMETER_NOT_SET,
    PARAMETER_BOOL,
    PARAMETER_INTEGER,
    PARAMETER_DOUBLE,
    PARAMETER_STRING,
    PARAMETER_BYTE_ARRAY,
    PARAMETER_BOOL_ARRAY,
    PARAMETER_INTEGER_ARRAY,
    PARAMETER_DOUBLE_ARRAY,
    PARAMETER_STRING_ARRAY,
};

inline std::string to_string(ParameterType type) {
    static const char* const NAMES[] = {"not set",    "bool",       "integer",       "double",       "string",
                                        "byte_array", "bool_array", "integer_array", "double_array", "string_array"};
    return NAMES[type];
}
inline std::ostream& operator<<(std::ostream& out, ParameterType type) { return out << to_string(type); }

class ParameterTypeException : public std::runtime_error {
public:
    ParameterTypeException(ParameterType expected, ParameterType actual)
        : std::runtime_error("expected [" + to_string(expected) + "] got [" + to_string(actual) + "]") {}
};

class ParameterValue {
public:
    ParameterValue() = default;
    explicit ParameterValue(const rcl_interfaces::msg::ParameterValue& message) : value_(message) {}
    explicit ParameterValue(bool value) { set(PARAMETER_BOOL, value_.bool_value, value); }
    explicit ParameterValue(int value) { set(PARAMETER_INTEGER, value_.integer_value, value); }
    explicit ParameterValue(std::int64_t value) { set(PARAMETER_INTEGER, value_.integer_value, value); }
    explicit ParameterValue(float value) { set(PARAMETER_DOUBLE, value_.double_value, value); }
    explicit ParameterValue(double value) { set(PARAMETER_DOUBLE, value_.double_value, value); }
    explicit ParameterValue(const std::string& value) { set(PARAMETER_STRING, value_.string_value, value); }
    explicit ParameterValue(const char* value) { set(PARAMETER_STRING, value_.string_value, value); }
    explicit ParameterValue(const std::vector<std::uint8_t>& value) { set(PARAMETER_BYTE_ARRAY, value_.byte_array_value, value); }
    explicit ParameterValue(const std::vector<bool>& value) { set(PARAMETER_BOOL_ARRAY, value_.bool_array_value, value); }
    explicit ParameterValue(const std::vector<int>& value)
        : ParameterValue(std::vector<std::int64_t>(value.begin(), value.end())) {}
    explicit ParameterValue(const std::vector<std::int64_t>& value) {
        set(PARAMETER_INTEGER_ARRAY, value_.integer_array_value, value);
    }
    explicit ParameterValue(const std::vector<float>& value)
        : ParameterValue(std::vector<double>(value.begin(), value.end())) {}
    explicit ParameterValue(const std::vector<double>& value) { set(PARAMETER_DOUBLE_ARRAY, value_.double_array_value, value); }
    explicit ParameterValue(const std::vector<std::string>& value) {
        set(PARAMETER_STRING_ARRAY, value_.string_array_value, value);
    }

    ParameterType get_type() const { return static_cast<ParameterType>(value_.type); }
    const rcl_interfaces::msg::ParameterValue& to_value_msg() const { return value_; }
    bool operator==(const ParameterValue& other) const { return value_ == other.value_; }
    bool operator!=(const ParameterValue& other) const { return !(*this == other); }

    // As one of the enumerators, or as a type of C++; throws a ParameterTypeException if it is of another type.
    template <ParameterType type>
    decltype(auto) get() const {
        if (type != get_type()) throw ParameterTypeException(type, get_type());
        if constexpr (type == PARAMETER_BOOL) return static_cast<const bool&>(value_.bool_value);
        if constexpr (type == PARAMETER_INTEGER) return static_cast<const std::int64_t&>(value_.integer_value);
        if constexpr (type == PARAMETER_DOUBLE) return static_cast<const double&>(value_.double_value);
        if constexpr (type == PARAMETER_STRING) return static_cast<const std::string&>(value_.string_value);
        if constexpr (type == PARAMETER_BYTE_ARRAY) return static_cast<const std::vector<std::uint8_t>&>(value_.byte_array_value);
        if constexpr (type == PARAMETER_BOOL_ARRAY) return static_cast<const std::vector<bool>&>(value_.bool_array_value);
        if constexpr (type == PARAMETER_INTEGER_ARRAY) return static_cast<const std::vector<std::int64_t>&>(value_.integer_array_value);
        if constexpr (type == PARAMETER_DOUBLE_ARRAY) return static_cast<const std::vector<double>&>(value_.double_array_value);
        if constexpr (type == PARAMETER_STRING_ARRAY) return static_cast<const std::vector<std::string>&>(value_.string_array_value);
    }
    template <class Type>
    auto get() const {
        constexpr auto type = type_of<Type>();
        if constexpr (std::is_arithmetic_v<Type>)
            return static_cast<Type>(get<type>());
        else if constexpr (type == PARAMETER_STRING)
            return std::string(get<type>());
        else
            return Type(get<type>().begin(), get<type>().end());
    }

    // The enumerator of a type of C++.
    template <class Type>
    static constexpr ParameterType type_of() {
        if constexpr (std::is_same_v<Type, bool>) return PARAMETER_BOOL;
        else if constexpr (std::is_integral_v<Type>) return PARAMETER_INTEGER;
        else if constexpr (std::is_floating_point_v<Type>) return PARAMETER_DOUBLE;
        else if constexpr (std::is_convertible_v<Type, std::string>) return PARAMETER_STRING;
        else if constexpr (std::is_same_v<Type, std::vector<std::uint8_t>>) return PARAMETER_BYTE_ARRAY;
        else if constexpr (std::is_same_v<Type, std::vector<bool>>) return PARAMETER_BOOL_ARRAY;
        else if constexpr (std::is_same_v<Type, std::vector<std::string>>) return PARAMETER_STRING_ARRAY;
        else if constexpr (std::is_integral_v<typename Type::value_type>) return PARAMETER_INTEGER_ARRAY;
        else return PARAMETER_DOUBLE_ARRAY;
    }

private:
    template <class Field, class Value>
    void set(ParameterType type, Field& field, const Value& value) {
        value_.type = type;
        field = Field(value);
    }
    rcl_interfaces::msg::ParameterValue value_;
};

inline std::string to_string(const ParameterValue& value) {
    const auto& message = value.to_value_msg();
    std::ostringstream out;
    out << std::boolalpha << std::showbase;
    auto many = [&](const auto& list) {
        out << '[';
        for (std::size_t index = 0; index < list.size(); ++index) out << (index > 0 ? ", " : "") << list[index];
        out << ']';
    };
    switch (value.get_type()) {
        case PARAMETER_NOT_SET: return "not set";
        case PARAMETER_BOOL: return message.bool_value ? "true" : "false";
        case PARAMETER_INTEGER: return std::to_string(message.integer_value);
        case PARAMETER_DOUBLE: return std::to_string(message.double_value);
        case PARAMETER_STRING: return message.string_value;
        case PARAMETER_BYTE_ARRAY: out << std::hex, many(std::vector<int>(message.byte_array_value.begin(), message.byte_array_value.end())); break;
        case PARAMETER_BOOL_ARRAY: many(std::vector<bool>(message.bool_array_value.begin(), message.bool_array_value.end())); break;
        case PARAMETER_INTEGER_ARRAY: many(message.integer_array_value); break;
        case PARAMETER_DOUBLE_ARRAY: many(message.double_array_value); break;
        case PARAMETER_STRING_ARRAY: many(message.string_array_value); break;
    }
    return out.str();
}

class Parameter {
    template <class Get>
    decltype(auto) converted(Get get) const {
        try {
            return get();
        } catch (const ParameterTypeException& error) {
            throw exceptions::InvalidParameterTypeException("parameter '" + name_ + "' has invalid type: " + error.what());
        }
    }

public:
    RCLCPP_SMART_PTR_DEFINITIONS(Parameter)
    Parameter() = default;
    explicit Parameter(std::string name) : name_(std::move(name)) {}
    Parameter(std::string name, const ParameterValue& value) : name_(std::move(name)), value_(value) {}
    template <class Value>
    Parameter(const std::string& name, Value value) : Parameter(name, ParameterValue(value)) {}

    static Parameter from_parameter_msg(const rcl_interfaces::msg::Parameter& message) {
        return Parameter(message.name, ParameterValue(message.value));
    }
    rcl_interfaces::msg::Parameter to_parameter_msg() const {
        rcl_interfaces::msg::Parameter message;
        message.name = name_;
        message.value = get_value_message();
        return message;
    }
    const std::string& get_name() const { return name_; }
    ParameterType get_type() const { return value_.get_type(); }
    std::string get_type_name() const { return to_string(get_type()); }
    const ParameterValue& get_parameter_value() const { return value_; }
    rcl_interfaces::msg::ParameterValue get_value_message() const { return value_.to_value_msg(); }
    template <ParameterType type>
    decltype(auto) get_value() const {
        return converted([&]() -> decltype(auto) { return value_.get<type>(); });
    }
    template <class Type>
    auto get_value() const {
        return converted([&] { return value_.get<Type>(); });
    }
    bool as_bool() const { return get_value<PARAMETER_BOOL>(); }
    std::int64_t as_int() const { return get_value<PARAMETER_INTEGER>(); }
    double as_double() const { return get_value<PARAMETER_DOUBLE>(); }
    const std::string& as_string() const { return get_value<PARAMETER_STRING>(); }
    const std::vector<std::uint8_t>& as_byte_array() const { return get_value<PARAMETER_BYTE_ARRAY>(); }
    const std::vector<bool>& as_bool_array() const { return get_value<PARAMETER_BOOL_ARRAY>(); }
    const std::vector<std::int64_t>& as_integer_array() const { return get_value<PARAMETER_INTEGER_ARRAY>(); }
    const std::vector<double>& as_double_array() const { return get_value<PARAMETER_DOUBLE_ARRAY>(); }
    const std::vector<std::string>& as_string_array() const { return get_value<PARAMETER_STRING_ARRAY>(); }
    std::string value_to_string() const { return to_string(value_); }
    bool operator==(const Parameter& other) const { return name_ == other.name_ && value_ == other.value_; }
    bool operator!=(const Parameter& other) const { return !(*this == other); }

private:
    std::string name_;
    ParameterValue value_;
};

inline std::ostream& operator<<(std::ostream& out, const Parameter& parameter) {
    return out << R"({"name": ")" << parameter.get_name() << R"(", "type": ")" << parameter.get_type_name()
               << R"(", "value": ")" << parameter.value_to_string() << "\"}";
}
inline std::string to_string(const Parameter& parameter) {
    std::ostringstream out;
    out << parameter;
    return out.str();
}

}  // namespace rclcpp
