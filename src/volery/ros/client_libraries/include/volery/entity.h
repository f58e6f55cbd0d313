// An entity of a node on the graph: a publisher, a subscription, a service or a timer.
#pragma once
#include <cstdint>
#include <string>
#include <utility>

#include "volery/abi.h"

// Marks a function that is not offered: code that calls it does not compile, and the compiler says why.
#define VOLERY_REFUSED(what) __attribute__((error("volery: " what)))

namespace volery {

constexpr std::int64_t NO_CALLABLE = -1;

// Removed from the graph with the last handle that shares it.
class Entity {
public:
    Entity(std::int64_t handle, std::string name, std::int64_t callable = NO_CALLABLE)
        : handle_(handle), name_(std::move(name)), callable_(callable) {}
    Entity(const Entity&) = delete;
    Entity& operator=(const Entity&) = delete;
    ~Entity() { close(); }

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

}  // namespace volery
