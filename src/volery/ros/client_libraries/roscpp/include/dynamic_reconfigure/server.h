// dynamic_reconfigure::Server: parameters that change while the node runs.
#pragma once
#include <boost/function.hpp>

#include "boost/thread/recursive_mutex.hpp"
#include "dynamic_reconfigure/Reconfigure.h"
#include "dynamic_reconfigure/config_tools.h"

namespace dynamic_reconfigure {

// Begins with the parameters of the node, limited to what is allowed.
template <class ConfigType>
class Server {
public:
    using CallbackType = boost::function<void(ConfigType&, std::uint32_t)>;

    explicit Server(const ros::NodeHandle& node = ros::NodeHandle("~")) : node_(node), own_(), mutex_(own_) { init(); }
    explicit Server(boost::recursive_mutex& mutex, const ros::NodeHandle& node = ros::NodeHandle("~"))
        : node_(node), mutex_(mutex) {
        init();
    }

    // Also call back at once, with all levels.
    void setCallback(const CallbackType& callback) {
        boost::recursive_mutex::scoped_lock lock(mutex_);
        callback_ = callback;
        if (callback_) callback_(config_, ~std::uint32_t{0});
        update(config_);
    }
    void clearCallback() { callback_ = CallbackType(); }
    void updateConfig(const ConfigType& config) {
        boost::recursive_mutex::scoped_lock lock(mutex_);
        update(config);
    }
    void getConfigDefault(ConfigType& config) const { config = ConfigType::__getDefault__(); }
    void getConfigMin(ConfigType& config) const { config = ConfigType::__getMin__(); }
    void getConfigMax(ConfigType& config) const { config = ConfigType::__getMax__(); }

private:
    void init() {
        boost::recursive_mutex::scoped_lock lock(mutex_);
        service_ = node_.advertiseService("set_parameters", &Server::set, this);
        descriptions_ = node_.advertise<ConfigDescription>("parameter_descriptions", 1, true);
        updates_ = node_.advertise<Config>("parameter_updates", 1, true);
        descriptions_.publish(ConfigType::__getDescriptionMessage__());
        config_.__fromServer__(node_);
        config_.__clamp__();
        update(config_);
    }
    bool set(Reconfigure::Request& request, Reconfigure::Response& response) {
        boost::recursive_mutex::scoped_lock lock(mutex_);
        ConfigType wanted = config_;
        wanted.__fromMessage__(request.config);
        wanted.__clamp__();
        auto const level = config_.__level__(wanted);
        if (callback_) callback_(wanted, level);
        update(wanted);
        wanted.__toMessage__(response.config);
        return true;
    }
    void update(const ConfigType& config) {
        config_ = config;
        config_.__toServer__(node_);
        Config message;
        config_.__toMessage__(message);
        updates_.publish(message);
    }

    ros::NodeHandle node_;
    boost::recursive_mutex own_;
    boost::recursive_mutex& mutex_;
    CallbackType callback_;
    ConfigType config_;
    ros::ServiceServer service_;
    ros::Publisher descriptions_, updates_;
};

}  // namespace dynamic_reconfigure
