// ros::ServiceServer, ros::ServiceClient and the functions about services.
#pragma once
#include <string>
#include <vector>

#include "ros/entity.h"
#include "ros/message.h"
#include "ros/names.h"

namespace ros {

// Copies share the service, which ends with the last copy.
class ServiceServer : public detail::Handle {
public:
    using Handle::Handle;
    std::string getService() const { return name(); }
};

using V_ServiceServer = std::vector<ServiceServer>;

namespace detail {

template <class Request, class Response>
bool call(std::int64_t client, const Request& request, Response& response) {
    auto answer = volery::request("ros.call", volery::Writer().put(client).put(to_bytes(request)));
    if (!answer.flag()) return false;
    from_bytes(answer, response);
    return true;
}

}  // namespace detail

class ServiceClient {
public:
    ServiceClient() = default;
    ServiceClient(std::int64_t handle, std::string name) : handle_(handle), name_(std::move(name)) {}

    // Block until the response arrives; return false without a server or if the handler fails.
    template <class Service>
    bool call(Service& service) {
        return call(service.request, service.response);
    }
    template <class Request, class Response>
    bool call(const Request& request, Response& response) {
        return isValid() && detail::call(handle_, request, response);
    }
    template <class Request, class Response>
    bool call(const Request& request, Response& response, const std::string&) {
        return call(request, response);
    }
    bool exists() { return waitForExistence(Duration(0.0)); }
    // A negative time-out means none.
    bool waitForExistence(Duration timeout = Duration(-1.0)) {
        auto const with = volery::Writer().put(name_).put(timeout.toNSec());
        return isValid() && volery::request("ros.wait_for_service", with).flag();
    }
    bool isPersistent() const { return false; }
    bool isValid() const { return handle_ >= 0; }
    void shutdown() { handle_ = -1; }
    std::string getService() const { return name_; }
    operator void*() const { return isValid() ? const_cast<ServiceClient*>(this) : nullptr; }

private:
    std::int64_t handle_ = -1;
    std::string name_;
};

namespace service {

inline bool waitForService(const std::string& name, Duration timeout = Duration(-1.0)) {
    return volery::request("ros.wait_for_service", volery::Writer().put(name).put(timeout.toNSec())).flag();
}
inline bool waitForService(const std::string& name, std::int32_t milliseconds) {
    return waitForService(name, Duration(milliseconds / 1000.0));
}
inline bool exists(const std::string& name, bool) { return waitForService(name, Duration(0.0)); }

template <class Service>
bool call(const std::string& name, Service& service) {
    auto const client = volery::request("ros.client", volery::Writer().put(name).put(Service::name_())).integer();
    return detail::call(client, service.request, service.response);
}

}  // namespace service
}  // namespace ros
