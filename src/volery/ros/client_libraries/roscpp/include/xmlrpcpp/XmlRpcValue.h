// XmlRpc::XmlRpcValue: a value of any kind, as parameters have them.
#pragma once
#include <cstdint>
#include <ctime>
#include <map>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

namespace XmlRpc {

class XmlRpcException {
public:
    explicit XmlRpcException(std::string message, int code = -1) : message_(std::move(message)), code_(code) {}
    const std::string& getMessage() const { return message_; }
    int getCode() const { return code_; }

private:
    std::string message_;
    int code_;
};

// The kind of a value never changes by itself: reading it as another one throws, also an integer as a double.
class XmlRpcValue {
public:
    enum Type {
        TypeInvalid, TypeBoolean, TypeInt, TypeDouble, TypeString, TypeDateTime, TypeBase64, TypeArray, TypeStruct
    };
    using BinaryData = std::vector<char>;
    using ValueArray = std::vector<XmlRpcValue>;
    using ValueStruct = std::map<std::string, XmlRpcValue>;
    using iterator = ValueStruct::iterator;
    using const_iterator = ValueStruct::const_iterator;

    XmlRpcValue() = default;
    XmlRpcValue(bool value) : type_(TypeBoolean), integer_(value) {}
    XmlRpcValue(int value) : type_(TypeInt), integer_(value) {}
    XmlRpcValue(double value) : type_(TypeDouble), real_(value) {}
    XmlRpcValue(const std::string& value) : type_(TypeString), text_(value) {}
    XmlRpcValue(const char* value) : XmlRpcValue(std::string(value)) {}

    // A struct without members yet.
    static XmlRpcValue ofMembers_() {
        XmlRpcValue made;
        made.type_ = TypeStruct;
        return made;
    }

    void clear() { *this = XmlRpcValue(); }
    bool valid() const { return type_ != TypeInvalid; }
    const Type& getType() const { return type_; }
    // Number of characters, elements or members.
    int size() const {
        if (type_ == TypeString) return static_cast<int>(text_.size());
        if (type_ == TypeArray) return static_cast<int>(array_.size());
        if (type_ == TypeStruct) return static_cast<int>(members_.size());
        throw XmlRpcException("type error");
    }
    void setSize(int size) { as(TypeArray), array_.resize(static_cast<std::size_t>(size)); }
    bool hasMember(const std::string& name) const { return type_ == TypeStruct && members_.count(name) > 0; }

    operator bool&() { return as(TypeBoolean), boolean(); }
    operator int&() { return as(TypeInt), integer_; }
    operator double&() { return as(TypeDouble), real_; }
    operator std::string&() { return as(TypeString), text_; }
    operator const bool&() const { return is(TypeBoolean), const_cast<XmlRpcValue*>(this)->boolean(); }
    operator const int&() const { return is(TypeInt), integer_; }
    operator const double&() const { return is(TypeDouble), real_; }
    operator const std::string&() const { return is(TypeString), text_; }

    XmlRpcValue& operator[](int index) {
        as(TypeArray);
        if (index < 0) throw XmlRpcException("range error: array index is negative");
        if (static_cast<std::size_t>(index) >= array_.size()) array_.resize(static_cast<std::size_t>(index) + 1);
        return array_[static_cast<std::size_t>(index)];
    }
    const XmlRpcValue& operator[](int index) const {
        is(TypeArray);
        if (index < 0 || index >= size()) throw XmlRpcException("range error: array index too large");
        return array_[static_cast<std::size_t>(index)];
    }
    XmlRpcValue& operator[](const std::string& name) { return as(TypeStruct), members_[name]; }
    XmlRpcValue& operator[](const char* name) { return (*this)[std::string(name)]; }
    const XmlRpcValue& operator[](const std::string& name) const {
        is(TypeStruct);
        auto const found = members_.find(name);
        if (found == members_.end()) throw XmlRpcException("No such member: " + name);
        return found->second;
    }
    const XmlRpcValue& operator[](const char* name) const { return (*this)[std::string(name)]; }
    iterator begin() { return is(TypeStruct), members_.begin(); }
    iterator end() { return is(TypeStruct), members_.end(); }
    const_iterator begin() const { return is(TypeStruct), members_.begin(); }
    const_iterator end() const { return is(TypeStruct), members_.end(); }

    bool operator==(const XmlRpcValue& other) const {
        return type_ == other.type_ && integer_ == other.integer_ && real_ == other.real_ && text_ == other.text_ &&
               array_ == other.array_ && members_ == other.members_;
    }
    bool operator!=(const XmlRpcValue& other) const { return !(*this == other); }

    std::ostream& write(std::ostream& out) const {
        if (type_ == TypeBoolean || type_ == TypeInt) return out << integer_;
        if (type_ == TypeDouble) return out << real_;
        if (type_ == TypeString) return out << text_;
        const char* between = "";
        if (type_ == TypeArray) {
            out << '{';
            for (const auto& one : array_) one.write(out << std::exchange(between, ","));
            return out << '}';
        }
        if (type_ != TypeStruct) return out;
        out << '[';
        for (const auto& [name, one] : members_) one.write(out << std::exchange(between, ",") << name << ':');
        return out << ']';
    }
    std::string toXml() const {
        switch (type_) {
            case TypeBoolean: return "<value><boolean>" + std::to_string(integer_) + "</boolean></value>";
            case TypeInt: return "<value><i4>" + std::to_string(integer_) + "</i4></value>";
            case TypeDouble: return "<value><double>" + std::to_string(real_) + "</double></value>";
            case TypeString: return "<value>" + text_ + "</value>";
            case TypeArray: {
                std::string all = "<value><array><data>";
                for (const auto& one : array_) all += one.toXml();
                return all + "</data></array></value>";
            }
            case TypeStruct: {
                std::string all = "<value><struct>";
                for (const auto& [name, one] : members_)
                    all += "<member><name>" + name + "</name>" + one.toXml() + "</member>";
                return all + "</struct></value>";
            }
            default: return "";
        }
    }

private:
    // A value without a kind becomes what it is first used as.
    void as(Type type) {
        if (type_ == TypeInvalid) type_ = type;
        is(type);
    }
    void is(Type type) const {
        if (type_ != type) throw XmlRpcException("type error");
    }
    bool& boolean() { return *reinterpret_cast<bool*>(&integer_); }

    Type type_ = TypeInvalid;
    int integer_ = 0;  // of a boolean the first byte
    double real_ = 0.0;
    std::string text_;
    ValueArray array_;
    ValueStruct members_;
};

inline std::ostream& operator<<(std::ostream& out, const XmlRpcValue& value) { return value.write(out); }

}  // namespace XmlRpc
