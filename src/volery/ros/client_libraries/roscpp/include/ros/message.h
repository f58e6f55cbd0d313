// Printing and comparison of generated messages.
#pragma once
#include <boost/array.hpp>
#include <boost/make_shared.hpp>
#include <boost/shared_ptr.hpp>
#include <cstdint>
#include <ostream>
#include <string>
#include <type_traits>
#include <vector>

#include "ros/time.h"
#include "volery/cdr.h"

namespace ros {

template <class Type, class = void>
struct is_message : std::false_type {};
template <class Type>
struct is_message<Type, std::void_t<decltype(Type::name_())>> : std::true_type {};

namespace detail {

// Prints a message as rostopic does.
class Printer {
public:
    Printer(std::ostream& out, int depth) : out_(out), depth_(depth) {}

    template <class Field>
    void operator()(const char* name, const Field& field) {
        out_ << std::string(static_cast<std::size_t>(2 * depth_), ' ') << name << ": ";
        show(field);
    }
    void nothing() {}

private:
    template <class Field>
    void show(const Field& field) {
        if constexpr (is_message<Field>::value) {
            out_ << '\n';
            Printer inner(out_, depth_ + 1);
            Field::each_(inner, field);
        } else {
            plain(field);
            out_ << '\n';
        }
    }
    template <class Field>
    void plain(const Field& field) {
        if constexpr (sizeof(Field) == 1 && std::is_integral_v<Field>)
            out_ << static_cast<int>(field);
        else
            out_ << field;
    }
    template <class Element>
    void plain(const std::vector<Element>& list) {
        many(list.data(), list.size());
    }
    template <class Element, std::size_t count>
    void plain(const boost::array<Element, count>& list) {
        many(list.data(), count);
    }
    template <class Element>
    void many(const Element* first, std::size_t count) {
        out_ << '[';
        for (std::size_t index = 0; index < count; ++index) {
            if (index > 0) out_ << ", ";
            if constexpr (is_message<Element>::value) {
                out_ << '\n';
                Printer inner(out_, depth_ + 1);
                Element::each_(inner, first[index]);
            } else {
                plain(first[index]);
            }
        }
        out_ << ']';
    }
    std::ostream& out_;
    int depth_;
};

using volery::from_bytes;
using volery::to_bytes;

}  // namespace detail

// Printing and comparison of messages. The namespace of each package imports these operators.
namespace message_operators {

template <class Message>
std::enable_if_t<is_message<Message>::value, std::ostream&> operator<<(std::ostream& out, const Message& message) {
    detail::Printer printer(out, 0);
    Message::each_(printer, message);
    return out;
}
template <class Message>
std::enable_if_t<is_message<Message>::value, bool> operator==(const Message& one, const Message& other) {
    return detail::to_bytes(one) == detail::to_bytes(other);
}
template <class Message>
std::enable_if_t<is_message<Message>::value, bool> operator!=(const Message& one, const Message& other) {
    return !(one == other);
}

}  // namespace message_operators
}  // namespace ros
