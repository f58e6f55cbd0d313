// ros::NodeHandle.
#pragma once
#ifndef BOOST_BIND_GLOBAL_PLACEHOLDERS
#define BOOST_BIND_GLOBAL_PLACEHOLDERS  // callbacks are bound with _1, as in roscpp's examples
#endif
#include <boost/bind.hpp>
#include <boost/function.hpp>
#include <map>
#include <string>
#include <vector>

#include "ros/init.h"
#include "ros/param.h"
#include "ros/publisher.h"
#include "ros/rate.h"
#include "ros/service.h"
#include "ros/subscriber.h"
#include "ros/timer.h"

namespace ros {

// A namespace of this node: "" is its own, "~" its private one. All handles belong to the same node.
class NodeHandle {
public:
    NodeHandle(const std::string& ns = "", const M_string& = {}) { enter("", ns); }
    NodeHandle(const NodeHandle& parent, const std::string& ns) { enter(parent.namespace_, ns); }
    NodeHandle(const NodeHandle&) = default;
    NodeHandle& operator=(const NodeHandle&) = default;

    const std::string& getNamespace() const { return namespace_; }
    const std::string& getUnresolvedNamespace() const { return namespace_; }
    std::string resolveName(const std::string& name, bool remap = true) const {
        return names::resolve(namespace_, name, remap);
    }
    bool ok() const { return ros::ok(); }
    void shutdown() {}

    // -- topics

    template <class Message>
    Publisher advertise(const std::string& topic, std::uint32_t queue_size, bool latch = false) {
        auto const name = resolveName(topic);
        auto with = volery::Writer().put(name).put(Message::name_());
        with.put(static_cast<std::int64_t>(queue_size)).put(latch);
        return Publisher(create("ros.advertise", with, name), latch);
    }

    template <class Parameter, class Class>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size, void (Class::*callback)(Parameter),
                         Class* object, const TransportHints& = {}) {
        return make_subscriber<Parameter>(topic, queue_size, [=](Parameter message) { (object->*callback)(message); });
    }
    template <class Parameter, class Class>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         void (Class::*callback)(Parameter) const, Class* object, const TransportHints& = {}) {
        return make_subscriber<Parameter>(topic, queue_size, [=](Parameter message) { (object->*callback)(message); });
    }
    template <class Parameter, class Class>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size, void (Class::*callback)(Parameter),
                         const boost::shared_ptr<Class>& object, const TransportHints& = {}) {
        return make_subscriber<Parameter>(topic, queue_size,
                                          [=](Parameter message) { (object.get()->*callback)(message); });
    }
    template <class Parameter>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size, void (*callback)(Parameter),
                         const TransportHints& = {}) {
        return make_subscriber<Parameter>(topic, queue_size, callback);
    }
    template <class Message>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         const boost::function<void(const boost::shared_ptr<Message const>&)>& callback,
                         const VoidConstPtr& = VoidConstPtr(), const TransportHints& = {}) {
        return make_subscriber<const boost::shared_ptr<Message const>&>(topic, queue_size, callback);
    }
    template <class Message, class Parameter>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         const boost::function<void(Parameter)>& callback,
                         const VoidConstPtr& = VoidConstPtr(), const TransportHints& = {}) {
        return make_subscriber<Parameter>(topic, queue_size, callback);
    }

    // -- services

    template <class Class, class Request, class Response>
    ServiceServer advertiseService(const std::string& service, bool (Class::*handler)(Request&, Response&),
                                   Class* object) {
        return serve<Request, Response>(service, [=](Request& request, Response& response) {
            return (object->*handler)(request, response);
        });
    }
    template <class Class, class Request, class Response>
    ServiceServer advertiseService(const std::string& service, bool (Class::*handler)(Request&, Response&),
                                   const boost::shared_ptr<Class>& object) {
        return serve<Request, Response>(service, [=](Request& request, Response& response) {
            return (object.get()->*handler)(request, response);
        });
    }
    template <class Request, class Response>
    ServiceServer advertiseService(const std::string& service, bool (*handler)(Request&, Response&)) {
        return serve<Request, Response>(service, handler);
    }
    template <class Request, class Response>
    ServiceServer advertiseService(const std::string& service,
                                   const boost::function<bool(Request&, Response&)>& handler) {
        return serve<Request, Response>(service, handler);
    }
    template <class Service>
    ServiceClient serviceClient(const std::string& service, bool = false, const M_string& = {}) {
        auto const name = resolveName(service);
        return {volery::request("ros.client", volery::Writer().put(name).put(Service::name_())).integer(), name};
    }

    // -- timers

    template <class Class>
    Timer createTimer(Duration period, void (Class::*callback)(const TimerEvent&), Class* object,
                      bool oneshot = false, bool autostart = true) const {
        return createTimer(period, TimerCallback([=](const TimerEvent& event) { (object->*callback)(event); }),
                           oneshot, autostart);
    }
    template <class Class>
    Timer createTimer(const Rate& rate, void (Class::*callback)(const TimerEvent&), Class* object,
                      bool oneshot = false, bool autostart = true) const {
        return createTimer(rate.expectedCycleTime(), callback, object, oneshot, autostart);
    }
    Timer createTimer(Duration period, const TimerCallback& callback, bool oneshot = false,
                      bool autostart = true) const {
        return Timer::make(period, callback, oneshot, autostart);
    }
    template <class Class>
    WallTimer createWallTimer(WallDuration period, void (Class::*callback)(const WallTimerEvent&), Class* object,
                              bool oneshot = false, bool autostart = true) const {
        WallTimerCallback const bound = [=](const WallTimerEvent& event) { (object->*callback)(event); };
        return createWallTimer(period, bound, oneshot, autostart);
    }
    WallTimer createWallTimer(WallDuration period, const WallTimerCallback& callback, bool oneshot = false,
                              bool autostart = true) const {
        return WallTimer::make(period, callback, oneshot, autostart);
    }

    // -- parameters

    template <class Value>
    bool getParam(const std::string& name, Value& value) const {
        return param::get(resolveName(name), value);
    }
    template <class Value>
    bool getParamCached(const std::string& name, Value& value) const {
        return getParam(name, value);
    }
    template <class Value>
    void setParam(const std::string& name, const Value& value) const {
        param::set(resolveName(name), value);
    }
    void setParam(const std::string& name, const char* value) const { param::set(resolveName(name), value); }
    bool hasParam(const std::string& name) const { return param::has(resolveName(name)); }
    bool deleteParam(const std::string& name) const { return param::del(resolveName(name)); }
    bool getParamNames(std::vector<std::string>& names) const { return param::getParamNames(names); }
    template <class Value>
    bool param(const std::string& name, Value& value, const Value& otherwise) const {
        return param::param(resolveName(name), value, otherwise);
    }
    template <class Value>
    Value param(const std::string& name, const Value& otherwise) const {
        return param::param(resolveName(name), otherwise);
    }

private:
    void enter(const std::string& parent, const std::string& ns) {
        namespace_ = volery::request("ros.node_handle", volery::Writer().put(parent).put(ns)).text();
    }
    static std::shared_ptr<detail::Entity> create(const char* request_name, const volery::Writer& with,
                                              const std::string& name,
                                              std::int64_t callable = detail::NO_CALLABLE) {
        return std::make_shared<detail::Entity>(volery::request(request_name, with).integer(), name, callable);
    }

    template <class Parameter, class Callback>
    Subscriber make_subscriber(const std::string& topic, std::uint32_t queue_size, Callback callback) {
        using Adapter = detail::Adapted<Parameter>;
        using Message = typename Adapter::Message;
        auto const callable = volery::register_callable([callback](volery::Reader in, volery::Writer&) {
            auto const message = detail::received<Message>(in);
            callback(Adapter::from(message));
        });
        auto const name = resolveName(topic);
        auto with = volery::Writer().put(name).put(Message::name_());
        with.put(static_cast<std::int64_t>(queue_size)).put(callable);
        return Subscriber(create("ros.subscribe", with, name, callable));
    }

    template <class Request, class Response, class Handler>
    ServiceServer serve(const std::string& service, Handler handler) {
        auto const callable = volery::register_callable([handler](volery::Reader in, volery::Writer& out) {
            Request request;
            Response response;
            detail::from_bytes(in, request);
            bool const done = handler(request, response);
            out.put(done).put(detail::to_bytes(response));
        });
        auto const name = resolveName(service);
        auto const with = volery::Writer().put(name).put(Request::name_()).put(callable);
        return ServiceServer(create("ros.serve", with, name, callable));
    }

    std::string namespace_;
};

namespace topic {

// Return the next message of a topic, or null after a time-out. A negative time-out means none.
template <class Message>
boost::shared_ptr<Message const> waitForMessage(const std::string& topic, Duration timeout = Duration(-1.0)) {
    auto const with = volery::Writer().put(topic).put(Message::name_()).put(timeout.toNSec());
    auto answer = volery::request("ros.wait_for_message", with);
    if (!answer.flag()) return {};
    return detail::received<Message>(answer);
}
template <class Message>
boost::shared_ptr<Message const> waitForMessage(const std::string& topic, NodeHandle& node,
                                                Duration timeout = Duration(-1.0)) {
    return waitForMessage<Message>(node.resolveName(topic), timeout);
}

}  // namespace topic
}  // namespace ros
