// rclcpp::Service and rclcpp::Client.
#pragma once
#include <chrono>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

#include "rclcpp/publisher.hpp"

struct rmw_request_id_t {
    std::int8_t writer_guid[16] = {};
    std::int64_t sequence_number = 0;
};

namespace rclcpp {

class ServiceBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(ServiceBase)
    virtual ~ServiceBase() = default;
    const char* get_service_name() const { return entity_->name().c_str(); }

protected:
    ServiceBase(const node_interfaces::NodeState::SharedPtr& node, const CallbackGroup::SharedPtr& group)
        : node_(node), group_(group) {}
    void open(const std::string& name, const char* type, bool deferred, volery::Callable callback) {
        auto const callable = volery::register_callable(std::move(callback));
        auto const with = volery::Writer().put(node_->number()).put(name).put(type).put(deferred).put(callable);
        auto answer = detail::ask("ros.serve", volery::Writer(with).put(node_->group(group_).number()));
        auto const number = answer.integer();
        entity_ = std::make_unique<volery::Entity>(number, answer.text(), callable);
    }
    void respond(std::int64_t id, const std::string& response) {
        volery::request("ros.respond", volery::Writer().put(entity_->handle()).put(id).put(response));
    }

private:
    node_interfaces::NodeState::SharedPtr node_;
    CallbackGroup::SharedPtr group_;
    std::unique_ptr<volery::Entity> entity_;
};

template <class Type>
class Service : public ServiceBase, public std::enable_shared_from_this<Service<Type>> {
    using Id = std::shared_ptr<rmw_request_id_t>;
    using Request = std::shared_ptr<typename Type::Request>;
    using Response = std::shared_ptr<typename Type::Response>;

public:
    RCLCPP_SMART_PTR_DEFINITIONS(Service)
    Service(const node_interfaces::NodeState::SharedPtr& node, const CallbackGroup::SharedPtr& group)
        : ServiceBase(node, group) {}

    // Called once after the construction: a deferred callback gets the service.
    template <class Callback>
    void serve(const std::string& name, Callback given) {
        constexpr bool answers = std::is_invocable_v<Callback&, Request, Response> ||
                                 std::is_invocable_v<Callback&, Id, Request, Response>;
        auto const callback = std::make_shared<Callback>(std::move(given));
        open(name, Type::name_(), !answers, [this, callback](volery::Reader in, volery::Writer& out) {
            auto const id = std::make_shared<rmw_request_id_t>();
            id->sequence_number = in.integer();
            auto const request = std::make_shared<typename Type::Request>();
            volery::from_bytes(in, *request);
            if constexpr (answers) {
                auto const response = std::make_shared<typename Type::Response>();
                if constexpr (std::is_invocable_v<Callback&, Request, Response>)
                    (*callback)(request, response);
                else
                    (*callback)(id, request, response);
                out.put(volery::to_bytes(*response));
            } else if constexpr (std::is_invocable_v<Callback&, Id, Request>) {
                (*callback)(id, request);
            } else {
                static_assert(std::is_invocable_v<Callback&, std::shared_ptr<Service>, Id, Request>,
                              "this callback does not take the service's request and response");
                (*callback)(this->shared_from_this(), id, request);
            }
        });
    }
    void send_response(rmw_request_id_t& id, typename Type::Response& response) {
        respond(id.sequence_number, volery::to_bytes(response));
    }
};

class ClientBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(ClientBase)
    virtual ~ClientBase() = default;
    const char* get_service_name() const { return entity_->name().c_str(); }
    bool service_is_ready() const { return volery::request("ros.service_ready", about()).flag(); }
    template <class Rep = std::int64_t, class Period = std::milli>
    bool wait_for_service(std::chrono::duration<Rep, Period> timeout = std::chrono::duration<Rep, Period>(-1)) const {
        auto const within = std::chrono::duration_cast<std::chrono::nanoseconds>(timeout).count();
        return volery::request("ros.wait_for_service", about().put(within)).flag();
    }

protected:
    ClientBase(const node_interfaces::NodeState::SharedPtr& node, const std::string& name, const char* type,
               const CallbackGroup::SharedPtr& group)
        : node_(node), group_(group) {
        auto answer = detail::ask("ros.client", volery::Writer().put(node->number()).put(name).put(type));
        auto const number = answer.integer();
        entity_ = std::make_unique<volery::Entity>(number, answer.text());
    }
    // Send a request; the callable gets the number that is returned, and the response.
    std::int64_t send(const std::string& request, std::int64_t callable) {
        auto const with = about().put(request).put(callable).put(node_->group(group_).number());
        return volery::request("ros.send", with).integer();
    }

private:
    volery::Writer about() const { return volery::Writer().put(entity_->handle()); }
    node_interfaces::NodeState::SharedPtr node_;
    CallbackGroup::SharedPtr group_;
    std::unique_ptr<volery::Entity> entity_;
};

namespace detail {

// A future with the number of its request, used as the future itself.
template <class Future>
struct FutureAndRequestId {
    Future future;
    std::int64_t request_id = 0;

    operator Future&() { return future; }
    auto get() { return future.get(); }
    bool valid() const noexcept { return future.valid(); }
    void wait() const { future.wait(); }
    template <class Rep, class Period>
    std::future_status wait_for(const std::chrono::duration<Rep, Period>& timeout) const {
        return future.wait_for(timeout);
    }
    template <class AnyClock, class Span>
    std::future_status wait_until(const std::chrono::time_point<AnyClock, Span>& time) const {
        return future.wait_until(time);
    }
};

}  // namespace detail

template <class Type>
class Client : public ClientBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(Client)
    using Request = typename Type::Request;
    using Response = typename Type::Response;
    using SharedRequest = std::shared_ptr<Request>;
    using SharedResponse = std::shared_ptr<Response>;
    using Promise = std::promise<SharedResponse>;
    using SharedPromise = std::shared_ptr<Promise>;
    using Future = std::future<SharedResponse>;
    using SharedFuture = std::shared_future<SharedResponse>;
    using SharedFutureWithRequest = std::shared_future<std::pair<SharedRequest, SharedResponse>>;
    using CallbackType = std::function<void(SharedFuture)>;
    using CallbackWithRequestType = std::function<void(SharedFutureWithRequest)>;
    struct FutureAndRequestId : detail::FutureAndRequestId<Future> {
        SharedFuture share() { return this->future.share(); }
        operator SharedFuture() { return share(); }
    };
    using SharedFutureAndRequestId = detail::FutureAndRequestId<SharedFuture>;
    using SharedFutureWithRequestAndRequestId = detail::FutureAndRequestId<SharedFutureWithRequest>;

    Client(const node_interfaces::NodeState::SharedPtr& node, const std::string& name,
           const CallbackGroup::SharedPtr& group)
        : ClientBase(node, name, Type::name_(), group),
          callable_(volery::register_callable([this](volery::Reader in, volery::Writer&) { answered(in); })) {}
    ~Client() override { volery::unregister_callable(callable_); }

    FutureAndRequestId async_send_request(SharedRequest request) {
        auto const promise = std::make_shared<Promise>();
        FutureAndRequestId made;
        made.future = promise->get_future();
        made.request_id = begin(*request, [promise](SharedResponse response) { promise->set_value(response); });
        return made;
    }
    template <class Callback, std::enable_if_t<std::is_invocable_v<Callback&, SharedFuture> ||
                                                   std::is_invocable_v<Callback&, SharedFutureWithRequest>, int> = 0>
    auto async_send_request(SharedRequest request, Callback callback) {
        if constexpr (std::is_invocable_v<Callback&, SharedFuture>) {
            auto const promise = std::make_shared<Promise>();
            SharedFutureAndRequestId made;
            made.future = promise->get_future().share();
            made.request_id = begin(*request, [promise, callback, future = made.future](SharedResponse response) mutable {
                promise->set_value(response);
                callback(future);
            });
            return made;
        } else {
            auto const promise = std::make_shared<std::promise<std::pair<SharedRequest, SharedResponse>>>();
            SharedFutureWithRequestAndRequestId made;
            made.future = promise->get_future().share();
            made.request_id = begin(*request, [promise, callback, request, future = made.future](SharedResponse response) mutable {
                promise->set_value({request, response});
                callback(future);
            });
            return made;
        }
    }
    bool remove_pending_request(std::int64_t request_id) { return pending_.erase(request_id) != 0; }
    template <class Future>
    auto remove_pending_request(const Future& future) -> decltype(future.request_id, bool()) {
        return remove_pending_request(future.request_id);
    }
    std::size_t prune_pending_requests() { return std::exchange(pending_, {}).size(); }

private:
    using Done = std::function<void(SharedResponse)>;
    std::int64_t begin(const Request& request, Done done) {
        auto const id = send(volery::to_bytes(request), callable_);
        pending_[id] = std::move(done);
        return id;
    }
    void answered(volery::Reader in) {
        auto const found = pending_.find(in.integer());
        if (found == pending_.end()) return;
        auto const response = std::make_shared<Response>();
        volery::from_bytes(in, *response);
        auto const done = std::move(found->second);
        pending_.erase(found);
        done(response);
    }
    std::int64_t callable_;
    std::map<std::int64_t, Done> pending_;
};

}  // namespace rclcpp
