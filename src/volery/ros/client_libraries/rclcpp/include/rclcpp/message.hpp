// What generated messages have in common, and messages as bytes.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <ostream>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "volery/cdr.h"

namespace rosidl_runtime_cpp {

// How members are initialised. Here they always have their defaults.
enum class MessageInitialization { ALL, SKIP, ZERO, DEFAULTS_ONLY };

// The bound is not checked.
template <class Element, std::size_t bound, class Allocator = std::allocator<Element>>
using BoundedVector = std::vector<Element, Allocator>;

}  // namespace rosidl_runtime_cpp

namespace volery {

template <class Message>
struct MessageOf {
    using SharedPtr = std::shared_ptr<Message>;
    using ConstSharedPtr = std::shared_ptr<Message const>;
    using UniquePtr = std::unique_ptr<Message>;
    using ConstUniquePtr = std::unique_ptr<Message const>;
    using WeakPtr = std::weak_ptr<Message>;
    using ConstWeakPtr = std::weak_ptr<Message const>;
};

template <class Type, class = void>
struct is_message : std::false_type {};
template <class Type>
struct is_message<Type, std::void_t<decltype(Type::name_()), decltype(&Type::MessageOf::SharedPtr::get)>>
    : std::true_type {};

template <class Message>
bool operator==(const MessageOf<Message>& one, const MessageOf<Message>& other) {
    return to_bytes(static_cast<const Message&>(one)) == to_bytes(static_cast<const Message&>(other));
}
template <class Message>
bool operator!=(const MessageOf<Message>& one, const MessageOf<Message>& other) {
    return !(one == other);
}

// Prints a message as YAML.
class YamlPrinter {
public:
    YamlPrinter(std::ostream& out, std::size_t depth) : out_(out), depth_(depth) {}

    template <class Field>
    void operator()(const char* name, const Field& field) {
        indent();
        out_ << name << ':';
        value(field);
    }
    void nothing() {}

private:
    template <class Field>
    void value(const Field& field) {
        if constexpr (has_parts<Field>::value) {
            out_ << '\n';
            YamlPrinter inner(out_, depth_ + 2);
            Field::each_(inner, field);
        } else if constexpr (std::is_same_v<Field, std::string>) {
            out_ << " \"" << field << "\"\n";
        } else if constexpr (std::is_same_v<Field, bool>) {
            out_ << (field ? " true\n" : " false\n");
        } else {
            out_ << ' ' << +field << '\n';
        }
    }
    template <class Element>
    void value(const std::vector<Element>& list) {
        many(list);
    }
    template <class Element, std::size_t count>
    void value(const std::array<Element, count>& list) {
        many(list);
    }
    template <class List>
    void many(const List& list) {
        out_ << (list.empty() ? " []\n" : "\n");
        for (const typename List::value_type element : list) {
            indent();
            out_ << '-';
            value(element);
        }
    }
    void indent() { out_ << std::string(depth_, ' '); }
    std::ostream& out_;
    std::size_t depth_;
};

namespace message_operators {

template <class Message>
std::enable_if_t<has_parts<Message>::value, std::string> to_yaml(const Message& message, bool = false) {
    std::ostringstream out;
    YamlPrinter printer(out, 0);
    Message::each_(printer, message);
    return out.str();
}

}  // namespace message_operators
}  // namespace volery

namespace rosidl_generator_traits {

using volery::message_operators::to_yaml;
template <class Message>
std::string name() {
    return Message::name_();
}
template <class Message>
std::string data_type() {
    return Message::name_();
}

}  // namespace rosidl_generator_traits

namespace rclcpp {

// A message in CDR.
class SerializedMessage {
public:
    using SharedPtr = std::shared_ptr<SerializedMessage>;
    SerializedMessage() = default;
    explicit SerializedMessage(std::size_t capacity) { reserve(capacity); }
    explicit SerializedMessage(std::string bytes) : bytes_(std::move(bytes)) {}
    std::size_t size() const { return bytes_.size(); }
    std::size_t capacity() const { return bytes_.capacity(); }
    void reserve(std::size_t capacity) { bytes_.reserve(capacity); }
    const std::string& bytes_in_cdr() const { return bytes_; }
    void set_bytes(std::string bytes) { bytes_ = std::move(bytes); }

    struct Buffer {
        const std::uint8_t* buffer;
        std::size_t buffer_length, buffer_capacity;
    };
    Buffer get_rcl_serialized_message() const {
        return {reinterpret_cast<const std::uint8_t*>(bytes_.data()), bytes_.size(), bytes_.capacity()};
    }

private:
    std::string bytes_;
};

template <class Message>
class Serialization {
public:
    void serialize_message(const void* message, SerializedMessage* into) const {
        into->set_bytes(volery::to_bytes(*static_cast<const Message*>(message)));
    }
    void deserialize_message(const SerializedMessage* from, void* message) const {
        const auto& bytes = from->bytes_in_cdr();
        volery::from_bytes(volery::Reader(bytes.data(), bytes.size()), *static_cast<Message*>(message));
    }
};

struct rmw_message_info_t {
    std::int64_t source_timestamp = 0, received_timestamp = 0;
    std::uint64_t publication_sequence_number = 0, reception_sequence_number = 0;
    bool from_intra_process = false;
};

// When a message was sent and received.
class MessageInfo {
public:
    MessageInfo() = default;
    explicit MessageInfo(const rmw_message_info_t& info) : info_(info) {}
    const rmw_message_info_t& get_rmw_message_info() const { return info_; }
    rmw_message_info_t& get_rmw_message_info() { return info_; }

private:
    rmw_message_info_t info_;
};

}  // namespace rclcpp

using rclcpp::rmw_message_info_t;
