// Encoding, decoding and printing of generated messages.
#pragma once
#include <algorithm>
#include <boost/array.hpp>
#include <boost/make_shared.hpp>
#include <boost/shared_ptr.hpp>
#include <cstdint>
#include <cstring>
#include <ostream>
#include <string>
#include <type_traits>
#include <vector>

#include "ros/time.h"

namespace ros {

template <class Type, class = void>
struct is_message : std::false_type {};
template <class Type>
struct is_message<Type, std::void_t<decltype(Type::name_())>> : std::true_type {};

namespace detail {

template <class Type>
constexpr bool is_number = std::is_arithmetic_v<Type>;

// Writes CDR as ROS 2 does: little endian, each number aligned to its size after a header of four bytes.
class CdrWriter {
public:
    template <class Field>
    void operator()(const char*, const Field& field) {
        put(field);
    }
    void nothing() { put(std::uint8_t{0}); }
    const std::string& bytes() const { return bytes_; }

private:
    template <class Number>
    std::enable_if_t<is_number<Number>> put(Number value) {
        align(sizeof value);
        bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    }
    void put(const std::string& text) {
        put(static_cast<std::uint32_t>(text.size() + 1));
        bytes_.append(text.c_str(), text.size() + 1);
    }
    void put(const Time& time) {
        put(static_cast<std::int32_t>(time.sec));
        put(time.nsec);
    }
    void put(const Duration& span) {
        put(span.sec);
        put(static_cast<std::uint32_t>(span.nsec));
    }
    template <class Message>
    std::enable_if_t<is_message<Message>::value> put(const Message& message) {
        Message::each_(*this, message);
    }
    template <class Element>
    void put(const std::vector<Element>& list) {
        put(static_cast<std::uint32_t>(list.size()));
        many(list.data(), list.size());
    }
    template <class Element, std::size_t count>
    void put(const boost::array<Element, count>& list) {
        many(list.data(), count);
    }
    template <class Element>
    void many(const Element* first, std::size_t count) {
        if constexpr (is_number<Element>) {
            if (count == 0) return;
            align(sizeof(Element));
            bytes_.append(reinterpret_cast<const char*>(first), count * sizeof(Element));
        } else {
            for (std::size_t index = 0; index < count; ++index) put(first[index]);
        }
    }
    void align(std::size_t size) { bytes_.append((size - (bytes_.size() - HEAD) % size) % size, '\0'); }

    static constexpr std::size_t HEAD = 4;
    std::string bytes_ = std::string("\0\1\0\0", HEAD);
};

class CdrReader {
public:
    explicit CdrReader(volery::Reader in) : start_(in.take(HEAD) + HEAD), in_(in) {}

    template <class Field>
    void operator()(const char*, Field& field) {
        get(field);
    }
    void nothing() {}

private:
    template <class Number>
    std::enable_if_t<is_number<Number>> get(Number& value) {
        align(sizeof value);
        std::memcpy(&value, in_.take(sizeof value), sizeof value);
    }
    std::uint32_t length() {
        std::uint32_t value = 0;
        get(value);
        return value;
    }
    void get(std::string& text) {
        auto const size = length();
        const char* data = in_.take(size);
        text.assign(data, size > 0 ? size - 1 : 0);
    }
    void get(Time& time) {
        get(time.sec);
        get(time.nsec);
    }
    void get(Duration& span) {
        get(span.sec);
        get(span.nsec);
    }
    template <class Message>
    std::enable_if_t<is_message<Message>::value> get(Message& message) {
        Message::each_(*this, message);
    }
    template <class Element>
    void get(std::vector<Element>& list) {
        list.resize(length());
        many(list.data(), list.size());
    }
    template <class Element, std::size_t count>
    void get(boost::array<Element, count>& list) {
        many(list.data(), count);
    }
    template <class Element>
    void many(Element* first, std::size_t count) {
        if constexpr (is_number<Element>) {
            if (count == 0) return;
            align(sizeof(Element));
            std::memcpy(first, in_.take(count * sizeof(Element)), count * sizeof(Element));
        } else {
            for (std::size_t index = 0; index < count; ++index) get(first[index]);
        }
    }
    void align(std::size_t size) {
        auto const at = static_cast<std::size_t>(in_.take(0) - start_);
        in_.take((size - at % size) % size);
    }

    static constexpr std::size_t HEAD = 4;
    const char* start_;
    volery::Reader in_;
};

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

// Not inlined: their execution time belongs to the cost of the call into ROS, not to the component's code.
template <class Message>
__attribute__((noinline)) std::string to_bytes(const Message& message) {
    CdrWriter writer;
    Message::each_(writer, message);
    return writer.bytes();
}

template <class Message>
__attribute__((noinline)) void from_bytes(volery::Reader in, Message& message) {
    CdrReader reader(in);
    Message::each_(reader, message);
}

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
