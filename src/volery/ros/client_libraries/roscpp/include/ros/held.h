// What this node has on the graph: a publisher, a subscription, a service or a timer.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "volery/abi.h"

namespace ros {
namespace detail {

constexpr std::int64_t NO_CALLABLE = -1;

// Taken off the graph with the last handle that shares it.
class Held {
public:
    Held(std::int64_t handle, std::string name, std::int64_t callable = NO_CALLABLE)
        : handle_(handle), name_(std::move(name)), callable_(callable) {}
    Held(const Held&) = delete;
    Held& operator=(const Held&) = delete;
    ~Held() { close(); }

    void close() noexcept {
        if (!open_) return;
        open_ = false;
        volery::try_request("ros.close", volery::Writer().put(handle_));
        if (callable_ != NO_CALLABLE) volery::unregister_callable(callable_);
    }
    bool open() const { return open_; }
    std::int64_t handle() const { return handle_; }
    const std::string& name() const { return name_; }

private:
    std::int64_t handle_;
    std::string name_;
    std::int64_t callable_;
    bool open_ = true;
};

// What ros::Publisher and its kin have in common.
class Handle {
public:
    Handle() = default;
    explicit Handle(std::shared_ptr<Held> held) : held_(std::move(held)) {}
    void shutdown() {
        if (held_) held_->close();
    }
    operator void*() const { return held_ && held_->open() ? held_.get() : nullptr; }
    bool operator==(const Handle& other) const { return held_ == other.held_; }
    bool operator!=(const Handle& other) const { return held_ != other.held_; }
    bool operator<(const Handle& other) const { return held_ < other.held_; }

protected:
    // Have something done with it; nothing if it is none.
    void order(const char* question) const {
        if (held_) volery::request(question, volery::Writer().put(held_->handle()));
    }
    std::string name() const { return held_ ? held_->name() : ""; }
    // A question about it; 0 if it is none.
    std::int64_t count(const char* question) const {
        return held_ ? volery::request(question, volery::Writer().put(held_->handle())).integer() : 0;
    }
    std::shared_ptr<Held> held_;
};

}  // namespace detail
}  // namespace ros
