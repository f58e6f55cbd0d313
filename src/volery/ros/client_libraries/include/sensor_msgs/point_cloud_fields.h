// Fields of sensor_msgs/PointCloud2: their places, and iterators over the values of one, for both libraries.
#pragma once
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace sensor_msgs {
namespace point_clouds {

// Bytes of a value; *datatype* is one of those of PointField.
inline std::uint32_t size_of(int datatype) {
    static constexpr std::uint32_t SIZES[] = {0, 1, 1, 2, 2, 4, 4, 4, 8};
    if (datatype < 1 || datatype > 8)
        throw std::runtime_error("PointField of type " + std::to_string(datatype) + " does not exist");
    return SIZES[datatype];
}

// Changes the fields and the number of points of a cloud.
template <class Cloud>
class Modifier {
    using Field = typename decltype(Cloud::fields)::value_type;

public:
    explicit Modifier(Cloud& cloud) : cloud_(cloud) {}
    std::size_t size() const { return cloud_.point_step == 0 ? 0 : cloud_.data.size() / cloud_.point_step; }
    void reserve(std::size_t points) { cloud_.data.reserve(points * cloud_.point_step); }
    void resize(std::size_t points) {
        cloud_.data.resize(points * cloud_.point_step);
        if (cloud_.height == 1 || cloud_.width * cloud_.height != points) {  // else the points fill the rows
            cloud_.height = 1;
            cloud_.width = static_cast<std::uint32_t>(points);
        }
        cloud_.row_step = cloud_.width * cloud_.point_step;
    }
    void clear() { resize(0); }

    // Of each field its name, its count of values and their type, as setPointCloud2Fields(2, "x", 1, FLOAT32, ...).
    void setPointCloud2Fields(int fields, ...) {
        start();
        va_list list;
        va_start(list, fields);
        for (int index = 0; index < fields; ++index) {
            std::string const name = va_arg(list, const char*);
            auto const count = va_arg(list, int);
            add(name, static_cast<std::uint32_t>(count), va_arg(list, int));
        }
        va_end(list);
        finish();
    }
    // "xyz", "rgb" and "rgba", each of which takes 16 bytes, as in PCL.
    void setPointCloud2FieldsByString(int fields, ...) {
        start();
        va_list list;
        va_start(list, fields);
        for (int index = 0; index < fields; ++index) {
            std::string const name = va_arg(list, const char*);
            if (name == "xyz") {
                for (const char* axis : {"x", "y", "z"}) add(axis, 1, Field::FLOAT32);
                cloud_.point_step += 4;
            } else if (name == "rgb" || name == "rgba") {
                add(name, 1, Field::FLOAT32);
                cloud_.point_step += 12;
            } else {
                va_end(list);
                throw std::runtime_error("Field " + name + " does not exist");
            }
        }
        va_end(list);
        finish();
    }

private:
    void start() {
        cloud_.fields.clear();
        cloud_.point_step = 0;
    }
    void add(const std::string& name, std::uint32_t count, int datatype) {
        Field field;
        field.name = name;
        field.offset = cloud_.point_step;
        field.count = count;
        field.datatype = static_cast<std::uint8_t>(datatype);
        cloud_.fields.push_back(field);
        cloud_.point_step += count * size_of(datatype);
    }
    void finish() {
        cloud_.row_step = cloud_.width * cloud_.point_step;
        cloud_.data.resize(static_cast<std::size_t>(cloud_.height) * cloud_.row_step);
    }
    Cloud& cloud_;
};

// Goes from point to point over the values of a field. *Cloud* is constant if the values are.
template <class Cloud, class Value>
class Iterator {
    using Byte = std::conditional_t<std::is_const_v<Cloud>, const std::uint8_t, std::uint8_t>;
    using Type = std::conditional_t<std::is_const_v<Cloud>, const Value, Value>;

public:
    using iterator_category = std::forward_iterator_tag;
    using value_type = Value;
    using difference_type = std::ptrdiff_t;
    using pointer = Type*;
    using reference = Type&;

    Iterator() = default;
    Iterator(Cloud& cloud, const std::string& field)
        : at_(cloud.data.data() + offset(cloud, field)),
          end_(cloud.data.data() + cloud.data.size() + (at_ - cloud.data.data())), step_(cloud.point_step) {}

    Type& operator*() const { return *reinterpret_cast<Type*>(at_); }
    Type& operator[](std::size_t index) const { return reinterpret_cast<Type*>(at_)[index]; }
    Iterator& operator++() { return at_ += step_, *this; }
    Iterator& operator+=(int points) { return at_ += points * static_cast<std::ptrdiff_t>(step_), *this; }
    Iterator operator+(int points) const { return Iterator(*this) += points; }
    bool operator==(const Iterator& other) const { return at_ == other.at_; }
    bool operator!=(const Iterator& other) const { return at_ != other.at_; }
    Iterator end() const {
        auto made = *this;
        made.at_ = end_;
        return made;
    }

private:
    static std::uint32_t offset(const Cloud& cloud, const std::string& name) {
        for (const auto& field : cloud.fields)
            if (field.name == name) return field.offset;
        auto const colour = std::string("bgra").find(name);  // the order of the bytes of "rgb" and "rgba"
        if (name.size() == 1 && colour != std::string::npos)
            for (const auto& field : cloud.fields)
                if (field.name == "rgb" || field.name == "rgba")
                    return field.offset + static_cast<std::uint32_t>(cloud.is_bigendian ? 3 - colour : colour);
        throw std::runtime_error("Field " + name + " does not exist");
    }
    Byte* at_ = nullptr;
    Byte* end_ = nullptr;
    std::uint32_t step_ = 0;
};

// A cloud whose points are moved by *motion*, a tf2::Transform, in the frame that they have then.
template <class Cloud, class Motion, class Header>
void move(const Cloud& in, Cloud& out, const Motion& motion, const Header& header) {
    if (&in != &out) out = in;
    out.header = header;
    Iterator<Cloud, float> x(out, "x"), y(out, "y"), z(out, "z");
    for (auto const end = x.end(); x != end; ++x, ++y, ++z) {
        auto const moved = motion * std::decay_t<decltype(motion.getOrigin())>(*x, *y, *z);
        *x = static_cast<float>(moved.x());
        *y = static_cast<float>(moved.y());
        *z = static_cast<float>(moved.z());
    }
}

}  // namespace point_clouds
}  // namespace sensor_msgs
