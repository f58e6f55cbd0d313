// Parameters. As in roscpp an integer is converted to a floating-point number, but not the other way round.
#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "ros/names.h"
#include "xmlrpcpp/XmlRpcValue.h"

namespace ros {
namespace detail {

// A parameter value is encoded as a letter for its kind, followed by the value.
inline void put_value(volery::Writer& out, bool value) { out.put("b").put(value); }
inline void put_value(volery::Writer& out, int value) { out.put("i").put(value); }
inline void put_value(volery::Writer& out, double value) { out.put("d").put(value); }
inline void put_value(volery::Writer& out, float value) { put_value(out, static_cast<double>(value)); }
inline void put_value(volery::Writer& out, const std::string& value) { out.put("s").put(value); }
inline void put_value(volery::Writer& out, const char* value) { out.put("s").put(value); }
template <class Value>
void put_value(volery::Writer& out, const std::vector<Value>& values) {
    out.put("l").put(values.size());
    for (const auto& value : values) put_value(out, static_cast<const Value&>(value));
}
template <class Value>
void put_value(volery::Writer& out, const std::map<std::string, Value>& values) {
    out.put("m").put(values.size());
    for (const auto& [name, value] : values) {
        out.put(name);
        put_value(out, value);
    }
}

inline void put_value(volery::Writer& out, const XmlRpc::XmlRpcValue& value) {
    using XmlRpc::XmlRpcValue;
    switch (value.getType()) {
        case XmlRpcValue::TypeBoolean: return put_value(out, static_cast<const bool&>(value));
        case XmlRpcValue::TypeInt: return put_value(out, static_cast<const int&>(value));
        case XmlRpcValue::TypeDouble: return put_value(out, static_cast<const double&>(value));
        case XmlRpcValue::TypeString: return put_value(out, static_cast<const std::string&>(value));
        case XmlRpcValue::TypeArray:
            out.put("l").put(value.size());
            for (int index = 0; index < value.size(); ++index) put_value(out, value[index]);
            return;
        case XmlRpcValue::TypeStruct:
            out.put("m").put(value.size());
            for (const auto& [name, one] : value) put_value(out.put(name), one);
            return;
        default: throw XmlRpc::XmlRpcException("a parameter that is set has no value");
    }
}

// Return false if the value is of another kind.
inline bool get_value(volery::Reader& in, bool& value) {
    auto const kind = in.text();
    if (kind == "b" || kind == "i") return value = in.flag(), true;
    return false;
}
inline bool get_value(volery::Reader& in, int& value) {
    auto const kind = in.text();
    if (kind == "b" || kind == "i") return value = static_cast<int>(in.integer()), true;
    return false;
}
inline bool get_value(volery::Reader& in, double& value) {
    auto const kind = in.text();
    if (kind == "d") return value = in.real(), true;
    if (kind == "b" || kind == "i") return value = static_cast<double>(in.integer()), true;
    return false;
}
inline bool get_value(volery::Reader& in, float& value) {
    double wide = value;
    bool const found = get_value(in, wide);
    value = static_cast<float>(wide);
    return found;
}
inline bool get_value(volery::Reader& in, std::string& value) {
    if (in.text() != "s") return false;
    value = in.text();
    return true;
}
template <class Value>
bool get_value(volery::Reader& in, std::vector<Value>& values) {
    if (in.text() != "l") return false;
    std::vector<Value> found;
    for (auto left = in.integer(); left > 0; --left) {
        Value value{};
        if (!get_value(in, value)) return false;
        found.push_back(value);
    }
    values = std::move(found);
    return true;
}
template <class Value>
bool get_value(volery::Reader& in, std::map<std::string, Value>& values) {
    if (in.text() != "m") return false;
    std::map<std::string, Value> found;
    for (auto left = in.integer(); left > 0; --left) {
        auto const name = in.text();
        Value value{};
        if (!get_value(in, value)) return false;
        found[name] = value;
    }
    values = std::move(found);
    return true;
}

inline bool get_value(volery::Reader& in, XmlRpc::XmlRpcValue& value) {
    auto const kind = in.text();
    value.clear();
    if (kind == "b")
        value = in.flag();
    else if (kind == "i")
        value = static_cast<int>(in.integer());
    else if (kind == "d")
        value = in.real();
    else if (kind == "s")
        value = in.text();
    else if (kind == "l") {
        auto const count = static_cast<int>(in.integer());
        value.setSize(count);
        for (int index = 0; index < count; ++index) get_value(in, value[index]);
    } else if (kind == "m") {
        value = XmlRpc::XmlRpcValue::ofMembers_();
        for (auto left = in.integer(); left > 0; --left) {
            auto const name = in.text();
            get_value(in, value[name]);
        }
    }
    return true;
}

}  // namespace detail

namespace param {

// Return whether a parameter of this kind exists; otherwise *value* is not changed.
template <class Value>
bool get(const std::string& name, Value& value) {
    auto answer = volery::request("ros.param_get", volery::Writer().put(name));
    return answer.flag() && detail::get_value(answer, value);
}
template <class Value>
bool getCached(const std::string& name, Value& value) {
    return get(name, value);
}
template <class Value>
void set(const std::string& name, const Value& value) {
    volery::Writer with;
    with.put(name);
    detail::put_value(with, value);
    volery::request("ros.param_set", with);
}
inline void set(const std::string& name, const char* value) { set(name, std::string(value)); }
inline bool has(const std::string& name) { return volery::request("ros.param_has", volery::Writer().put(name)).flag(); }
inline bool del(const std::string& name) { return volery::request("ros.param_delete", volery::Writer().put(name)).flag(); }
template <class Value>
bool param(const std::string& name, Value& value, const Value& otherwise) {
    if (get(name, value)) return true;
    value = otherwise;
    return false;
}
template <class Value>
Value param(const std::string& name, const Value& otherwise) {
    Value value{};
    param(name, value, otherwise);
    return value;
}
inline bool search(const std::string& ns, const std::string& key, std::string& result) {
    auto answer = volery::request("ros.param_search", volery::Writer().put(ns).put(key));
    result = answer.text();
    return !result.empty();
}
inline bool search(const std::string& key, std::string& result) { return search("", key, result); }
inline bool getParamNames(std::vector<std::string>& names) {
    auto answer = volery::request("ros.param_names");
    names.resize(static_cast<std::size_t>(answer.integer()));
    for (auto& name : names) name = answer.text();
    return true;
}

}  // namespace param
}  // namespace ros
