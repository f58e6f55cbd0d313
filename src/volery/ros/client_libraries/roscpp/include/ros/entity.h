// An entity of this node on the graph: a publisher, a subscription, a service or a timer.
#pragma once
#include <boost/shared_ptr.hpp>
#include <boost/weak_ptr.hpp>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "volery/entity.h"

namespace ros {
namespace detail {

using volery::Entity;
using volery::NO_CALLABLE;

using VoidConstPtr = boost::shared_ptr<void const>;

// An object that callbacks belong to: they are not called once it is gone. Without an object always alive.
class Tracked {
public:
    explicit Tracked(const VoidConstPtr& object) : object_(object), stated_(object != nullptr) {}
    // Return false if the object is gone; otherwise hold it while the callback runs.
    bool hold(VoidConstPtr& held) const {
        held = object_.lock();
        return !stated_ || held != nullptr;
    }

private:
    boost::weak_ptr<void const> object_;
    bool stated_;
};

// Base class of ros::Publisher, ros::Subscriber, ros::ServiceServer and ros::Timer.
class Handle {
public:
    Handle() = default;
    explicit Handle(std::shared_ptr<Entity> entity) : entity_(std::move(entity)) {}
    void shutdown() {
        if (entity_) entity_->close();
    }
    operator void*() const { return entity_ && entity_->open() ? entity_.get() : nullptr; }
    bool operator==(const Handle& other) const { return entity_ == other.entity_; }
    bool operator!=(const Handle& other) const { return entity_ != other.entity_; }
    bool operator<(const Handle& other) const { return entity_ < other.entity_; }

protected:
    // Make a request about the entity; without an entity do nothing.
    void request(const char* request_name) const {
        if (entity_) volery::request(request_name, volery::Writer().put(entity_->handle()));
    }
    std::string name() const { return entity_ ? entity_->name() : ""; }
    // Make a request about the entity that returns a number; without an entity return 0.
    std::int64_t count(const char* request_name) const {
        return entity_ ? volery::request(request_name, volery::Writer().put(entity_->handle())).integer() : 0;
    }
    std::shared_ptr<Entity> entity_;
};

}  // namespace detail
}  // namespace ros
