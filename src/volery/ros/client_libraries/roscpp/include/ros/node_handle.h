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
        AdvertiseOptions options;
        options.init<Message>(topic, queue_size);
        options.latch = latch;
        return advertise(options);
    }
    template <class Message>
    Publisher advertise(const std::string& topic, std::uint32_t queue_size, const SubscriberStatusCallback& connect,
                        const SubscriberStatusCallback& disconnect = SubscriberStatusCallback(),
                        const VoidConstPtr& tracked = VoidConstPtr(), bool latch = false) {
        auto options = AdvertiseOptions::create<Message>(topic, queue_size, connect, disconnect, tracked, nullptr);
        options.latch = latch;
        return advertise(options);
    }
    Publisher advertise(AdvertiseOptions& options) {
        auto const name = resolveName(options.topic);
        auto with = volery::Writer().put(name).put(options.datatype);
        with.put(static_cast<std::int64_t>(options.queue_size)).put(options.latch);
        auto const publisher = create("ros.advertise", with, name);
        if (options.connect_cb || options.disconnect_cb) watch(*publisher, options);
        return Publisher(publisher, options.latch);
    }

    // A member function of an object, which may take the message in each of the forms that Adapter knows. An object
    // that is given as a shared pointer is tracked.
    template <class Parameter, class Class>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size, void (Class::*callback)(Parameter),
                         Class* object, const TransportHints& = {}) {
        return call_member<Parameter>(topic, queue_size, callback, object, {});
    }
    template <class Parameter, class Class>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         void (Class::*callback)(Parameter) const, Class* object, const TransportHints& = {}) {
        return call_member<Parameter>(topic, queue_size, callback, object, {});
    }
    template <class Parameter, class Class>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size, void (Class::*callback)(Parameter),
                         const boost::shared_ptr<Class>& object, const TransportHints& = {}) {
        return call_member<Parameter>(topic, queue_size, callback, object.get(), object);
    }
    template <class Parameter, class Class>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         void (Class::*callback)(Parameter) const, const boost::shared_ptr<Class>& object,
                         const TransportHints& = {}) {
        return call_member<Parameter>(topic, queue_size, callback, object.get(), object);
    }
    // The same where the type of the message is given: subscribe<Message>(...).
    template <class Message, class Class>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         void (Class::*callback)(const boost::shared_ptr<Message const>&), Class* object,
                         const TransportHints& = {}) {
        return call_member<const boost::shared_ptr<Message const>&>(topic, queue_size, callback, object, {});
    }
    template <class Message, class Class>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         void (Class::*callback)(const boost::shared_ptr<Message const>&) const, Class* object,
                         const TransportHints& = {}) {
        return call_member<const boost::shared_ptr<Message const>&>(topic, queue_size, callback, object, {});
    }
    template <class Message, class Class>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         void (Class::*callback)(const boost::shared_ptr<Message const>&),
                         const boost::shared_ptr<Class>& object, const TransportHints& = {}) {
        return call_member<const boost::shared_ptr<Message const>&>(topic, queue_size, callback, object.get(), object);
    }
    template <class Message, class Class>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         void (Class::*callback)(const boost::shared_ptr<Message const>&) const,
                         const boost::shared_ptr<Class>& object, const TransportHints& = {}) {
        return call_member<const boost::shared_ptr<Message const>&>(topic, queue_size, callback, object.get(), object);
    }
    template <class Parameter>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size, void (*callback)(Parameter),
                         const TransportHints& = {}) {
        return call<Parameter>(topic, queue_size, callback, {});
    }
    template <class Message>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         void (*callback)(const boost::shared_ptr<Message const>&), const TransportHints& = {}) {
        return call<const boost::shared_ptr<Message const>&>(topic, queue_size, callback, {});
    }
    template <class Message>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         const boost::function<void(const boost::shared_ptr<Message const>&)>& callback,
                         const VoidConstPtr& tracked = VoidConstPtr(), const TransportHints& = {}) {
        return call<const boost::shared_ptr<Message const>&>(topic, queue_size, callback, tracked);
    }
    template <class Message, class Parameter>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         const boost::function<void(Parameter)>& callback,
                         const VoidConstPtr& tracked = VoidConstPtr(), const TransportHints& = {}) {
        return call<Parameter>(topic, queue_size, callback, tracked);
    }
    Subscriber subscribe(SubscribeOptions& options) {
        detail::Tracked const tracked(options.tracked_object);
        auto const callable =
            volery::register_callable([deliver = options.deliver_, tracked](volery::Reader in, volery::Writer&) {
                VoidConstPtr held;
                if (tracked.hold(held)) deliver(in);
            });
        auto const name = resolveName(options.topic);
        auto with = volery::Writer().put(name).put(options.datatype);
        with.put(static_cast<std::int64_t>(options.queue_size)).put(callable).put(queue_of(options.callback_queue));
        return Subscriber(create("ros.subscribe", with, name, callable));
    }

    // Queue of the callbacks that are made from now on; null for the node's own.
    void setCallbackQueue(CallbackQueueInterface* queue) { queue_ = queue; }
    CallbackQueueInterface* getCallbackQueue() const { return queue_ != nullptr ? queue_ : getGlobalCallbackQueue(); }

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
        return Timer::make(period, callback, oneshot, autostart, queue_of(nullptr));
    }
    Timer createTimer(TimerOptions& options) const {
        auto const queue = queue_of(options.callback_queue);
        return Timer::make(options.period, options.callback, options.oneshot, options.autostart, queue);
    }
    template <class Class>
    WallTimer createWallTimer(WallDuration period, void (Class::*callback)(const WallTimerEvent&), Class* object,
                              bool oneshot = false, bool autostart = true) const {
        WallTimerCallback const bound = [=](const WallTimerEvent& event) { (object->*callback)(event); };
        return createWallTimer(period, bound, oneshot, autostart);
    }
    WallTimer createWallTimer(WallDuration period, const WallTimerCallback& callback, bool oneshot = false,
                              bool autostart = true) const {
        return WallTimer::make(period, callback, oneshot, autostart, queue_of(nullptr));
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
    // Search upwards from this namespace; the result is the full name.
    bool searchParam(const std::string& key, std::string& result) const {
        return param::search(namespace_, key, result);
    }
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

    std::int64_t queue_of(CallbackQueueInterface* stated) const {
        return detail::number_of(stated != nullptr ? stated : queue_);
    }
    template <class Parameter, class Callback>
    Subscriber call(const std::string& topic, std::uint32_t queue_size, Callback callback, const VoidConstPtr& tracked) {
        SubscribeOptions options;
        options.topic = topic;
        options.queue_size = queue_size;
        options.datatype = detail::Adapted<Parameter>::Message::name_();
        options.deliver_ = detail::delivering<Parameter>(callback);
        options.tracked_object = tracked;
        return subscribe(options);
    }
    template <class Parameter, class Member, class Class>
    Subscriber call_member(const std::string& topic, std::uint32_t queue_size, Member callback, Class* object,
                           const VoidConstPtr& tracked) {
        return call<Parameter>(
            topic, queue_size, [=](Parameter message) { (object->*callback)(message); }, tracked);
    }
    void watch(const detail::Entity& publisher, const AdvertiseOptions& options) {
        detail::Tracked const tracked(options.tracked_object);
        auto const callable = volery::register_callable(
            [handle = publisher.handle(), options, tracked](volery::Reader in, volery::Writer&) {
                bool const connected = in.flag();
                auto const connection = in.integer();
                auto const topic = in.text();
                SingleSubscriberPublisher const one(handle, connection, topic, in.text());
                VoidConstPtr held;
                auto const& callback = connected ? options.connect_cb : options.disconnect_cb;
                if (callback && tracked.hold(held)) callback(one);
            });
        auto const with = volery::Writer().put(publisher.handle()).put(callable).put(queue_of(options.callback_queue));
        volery::request("ros.watch", with);
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
        auto const with = volery::Writer().put(name).put(Request::name_()).put(callable).put(queue_of(nullptr));
        return ServiceServer(create("ros.serve", with, name, callable));
    }

    std::string namespace_;
    CallbackQueueInterface* queue_ = nullptr;
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
