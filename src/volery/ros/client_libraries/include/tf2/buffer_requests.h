// The tree of transforms that the graph keeps, with times in nanoseconds. It is included after tf2/geometry.h.
#pragma once
#include <algorithm>
#include <cstdint>
#include <string>

#include "tf2/exceptions.h"
#include "volery/cdr.h"

namespace tf2 {

// Put transforms in place of those to the same frames, or behind the others.
template <class Transforms>
void merge(Transforms& into, const Transforms& transforms) {
    for (const auto& transform : transforms) {
        auto same = [&](const auto& one) { return one.child_frame_id == transform.child_frame_id; };
        auto const before = std::find_if(into.begin(), into.end(), same);
        if (before != into.end())
            *before = transform;
        else
            into.push_back(transform);
    }
}

class BufferRequests {
public:
    explicit BufferRequests(std::int64_t cache_ns) : cache_ns_(cache_ns) {}
    BufferRequests(const BufferRequests&) = delete;
    BufferRequests& operator=(const BufferRequests&) = delete;
    virtual ~BufferRequests() = default;

    bool setTransform(const geometry::TransformStamped& transform, const std::string&, bool is_static = false) {
        auto const with = about().put(volery::to_bytes(transform)).put(is_static);
        return volery::request("ros.tf_set", with).flag();
    }
    void clear() { volery::request("ros.tf_clear", about()); }
    std::string allFramesAsString() const { return volery::request("ros.tf_frames", about()).text(); }

    // Number of the tree on the graph, which is made at its first use.
    std::int64_t number_() const {
        if (number < 0) number = volery::request("ros.tf_buffer", volery::Writer().put(cache_ns_)).integer();
        return number;
    }
    bool can_transform_(const std::string& target, const std::string& source, std::int64_t time_ns,
                        std::int64_t timeout_ns, std::string* error) const {
        auto const reason = volery::request("ros.tf_can", about(target, source, time_ns, timeout_ns)).text();
        if (error != nullptr) *error = reason;
        return reason.empty();
    }

protected:
    // With a time-out wait until the transform is available. Throws a TransformException if it is not.
    geometry::TransformStamped look_up(const std::string& target, const std::string& source, std::int64_t time_ns,
                                       std::int64_t timeout_ns) const {
        auto answer = volery::request("ros.tf_look_up", about(target, source, time_ns, timeout_ns));
        if (!answer.flag()) {
            auto const kind = answer.text();
            detail::raise(kind, answer.text());
        }
        geometry::TransformStamped made;
        volery::from_bytes(answer, made);
        return made;
    }
    // The same between frames at different times, through a frame that is fixed.
    geometry::TransformStamped look_up(const std::string& target, std::int64_t target_ns, const std::string& source,
                                       std::int64_t source_ns, const std::string& fixed_frame,
                                       std::int64_t timeout_ns) const {
        auto const first = look_up(fixed_frame, source, source_ns, timeout_ns);
        auto last = look_up(target, fixed_frame, target_ns, timeout_ns);
        last.transform = toMsg(transform_of(last) * transform_of(first));
        last.child_frame_id = source;
        return last;
    }

private:
    volery::Writer about() const { return volery::Writer().put(number_()); }
    volery::Writer about(const std::string& target, const std::string& source, std::int64_t time_ns,
                         std::int64_t timeout_ns) const {
        return about().put(target).put(source).put(time_ns).put(timeout_ns);
    }
    std::int64_t cache_ns_;
    mutable std::int64_t number = -1;
};

}  // namespace tf2
