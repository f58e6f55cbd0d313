// CDR: the encoding of messages in ROS 2, which the graph uses for those of ROS 1, too.
#pragma once
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "volery/abi.h"

namespace volery {

template <class Type>
constexpr bool is_number = std::is_arithmetic_v<Type>;

// Whether a type shows its parts to a visitor, as generated messages do: Type::each_(visit, message).
struct AnyVisitor {
    template <class Field>
    void operator()(const char*, const Field&) {}
    void nothing() {}
};
template <class Type, class = void>
struct has_parts : std::false_type {};
template <class Type>
struct has_parts<Type, std::void_t<decltype(Type::each_(std::declval<AnyVisitor&>(), std::declval<const Type&>()))>>
    : std::true_type {};

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
    template <class Message>
    std::enable_if_t<has_parts<Message>::value> put(const Message& message) {
        Message::each_(*this, message);
    }
    template <class Element>
    void put(const std::vector<Element>& list) {
        put(static_cast<std::uint32_t>(list.size()));
        if constexpr (std::is_same_v<Element, bool>)
            for (bool const one : list) put(static_cast<std::uint8_t>(one));  // its elements are bits
        else
            many(list.data(), list.size());
    }
    template <template <class, std::size_t> class Array, class Element, std::size_t count>
    void put(const Array<Element, count>& list) {
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
    template <class Message>
    std::enable_if_t<has_parts<Message>::value> get(Message& message) {
        Message::each_(*this, message);
    }
    template <class Element>
    void get(std::vector<Element>& list) {
        list.resize(length());
        if constexpr (std::is_same_v<Element, bool>)
            for (std::size_t index = 0; index < list.size(); ++index) list[index] = *in_.take(1) != 0;
        else
            many(list.data(), list.size());
    }
    template <template <class, std::size_t> class Array, class Element, std::size_t count>
    void get(Array<Element, count>& list) {
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

}  // namespace volery
