// Templates that the generated glue of a component uses.
#pragma once
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "I_RosDron.h"
#include "volery/abi.h"
#include "volery/types.h"

namespace volery {

inline void put(Writer& out, bool value) { out.put(value); }
inline void put(Writer& out, std::int64_t value) { out.put(value); }
inline void put(Writer& out, double value) { out.put(value); }
inline void put(Writer& out, const std::string& value) { out.put(value); }
inline void put(Writer& out, const std::vector<std::uint8_t>& value) {
    out.put(reinterpret_cast<const char*>(value.data()), value.size());
}
inline void put(Writer& out, const Position& value) {
    out.put(value.latitude).put(value.longitude).put(value.altitude).put(static_cast<int>(value.reference));
}
template <class Value>
void put(Writer& out, const std::vector<Value>& values) {
    out.put(values.size());
    for (const auto& value : values) put(out, value);
}

inline void take(Reader& in, bool& value) { value = in.flag(); }
inline void take(Reader& in, std::int64_t& value) { value = in.integer(); }
inline void take(Reader& in, double& value) { value = in.real(); }
inline void take(Reader& in, std::string& value) { value = in.text(); }
inline void take(Reader& in, std::vector<std::uint8_t>& value) {
    auto const bytes = in.text();
    value.assign(bytes.begin(), bytes.end());
}
inline void take(Reader& in, Position& value) {
    value.latitude = in.real();
    value.longitude = in.real();
    value.altitude = in.real();
    value.reference = static_cast<Reference>(in.integer());
}
template <class Value>
void take(Reader& in, std::vector<Value>& values) {
    values.resize(static_cast<std::size_t>(in.integer()));
    for (auto& value : values) take(in, value);
}
template <class Value>
Value get(Reader& in) {
    Value value{};
    take(in, value);
    return value;
}

// A required port. The framework knows the component at its other end.
class Port {
public:
    Port(const char* port, std::size_t index) : port_(port), index_(index) {}

protected:
    template <class Result, class... Arguments>
    Result call(const char* operation, const Arguments&... arguments) const {
        Writer encoded;
        encoded.put(port_).put(index_).put(operation);
        (put(encoded, arguments), ...);
        auto reply = request("port", encoded);
        if constexpr (!std::is_void_v<Result>) return get<Result>(reply);
    }

private:
    const char* port_;
    std::size_t index_;
};

// The components that a required port is connected to. The objects live as long as the component, that is, as
// long as the program.
template <class Interface, class Implementation>
Interface& one(const char* port) {
    return *new Implementation(port, 0);
}

template <class Interface, class Implementation>
const std::vector<Interface*>& many(const char* port) {
    auto* all = new std::vector<Interface*>;
    auto const count = request("connected", Writer().put(port)).integer();
    for (std::int64_t index = 0; index < count; ++index)
        all->push_back(new Implementation(port, static_cast<std::size_t>(index)));
    return *all;
}

template <class Class, class... Required>
constexpr void check_constructor() {
    static_assert(std::is_constructible_v<Class, Required...> || std::is_default_constructible_v<Class>,
                  "the component's class must have a constructor that takes its required ports, in the order of the "
                  "model, or one that takes nothing");
}

template <class Class, class = void>
struct has_run : std::false_type {};
template <class Class>
struct has_run<Class, std::void_t<decltype(std::declval<Class&>().run())>> : std::true_type {};

// The only object of a component.
template <class Class>
class Component {
public:
    template <class... Required>
    void make(Required&&... required) {
        if constexpr (std::is_constructible_v<Class, Required...>)
            object_ = new Class(std::forward<Required>(required)...);
        else
            object_ = new Class();
    }
    void run() {
        if constexpr (has_run<Class>::value)
            object_->run();
        else
            throw std::logic_error("the component is active, but its class has no run()");
    }
    Class* operator->() { return object_; }

private:
    Class* object_ = nullptr;
};

}  // namespace volery
