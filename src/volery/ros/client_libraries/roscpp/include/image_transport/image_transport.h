// image_transport with its transport "raw": images as they are.
#pragma once
#include "ros/ros.h"
#include "sensor_msgs/CameraInfo.h"
#include "sensor_msgs/Image.h"

namespace image_transport {

class TransportHints {
public:
    explicit TransportHints(const std::string& transport = "raw", const ros::TransportHints& = {},
                            const ros::NodeHandle& = ros::NodeHandle("~"), const std::string& = "")
        : transport_(transport) {}
    const std::string& getTransport() const { return transport_; }

private:
    std::string transport_;
};

class Publisher : public ros::Publisher {
public:
    Publisher() = default;
    explicit Publisher(ros::Publisher publisher) : ros::Publisher(std::move(publisher)) {}
};

class Subscriber : public ros::Subscriber {
public:
    Subscriber() = default;
    explicit Subscriber(ros::Subscriber subscription) : ros::Subscriber(std::move(subscription)) {}
    std::string getTransport() const { return "raw"; }
};

// An image and the calibration of its camera, in the topic camera_info beside it.
class CameraPublisher {
public:
    CameraPublisher() = default;
    CameraPublisher(ros::NodeHandle node, const std::string& topic, std::uint32_t queue_size, bool latch)
        : images_(node.advertise<sensor_msgs::Image>(topic, queue_size, latch)),
          infos_(node.advertise<sensor_msgs::CameraInfo>(topic.substr(0, topic.rfind('/') + 1) + "camera_info",
                                                         queue_size, latch)) {}
    void publish(const sensor_msgs::Image& image, const sensor_msgs::CameraInfo& info) const {
        images_.publish(image);
        infos_.publish(info);
    }
    void publish(const sensor_msgs::ImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info) const {
        publish(*image, *info);
    }
    std::string getTopic() const { return images_.getTopic(); }
    std::string getInfoTopic() const { return infos_.getTopic(); }
    std::uint32_t getNumSubscribers() const {
        return std::max(images_.getNumSubscribers(), infos_.getNumSubscribers());
    }

private:
    ros::Publisher images_, infos_;
};

class ImageTransport {
public:
    explicit ImageTransport(const ros::NodeHandle& node) : node_(node) {}

    Publisher advertise(const std::string& topic, std::uint32_t queue_size, bool latch = false) {
        return Publisher(node_.advertise<sensor_msgs::Image>(topic, queue_size, latch));
    }
    CameraPublisher advertiseCamera(const std::string& topic, std::uint32_t queue_size, bool latch = false) {
        return {node_, topic, queue_size, latch};
    }
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         const boost::function<void(const sensor_msgs::ImageConstPtr&)>& callback,
                         const ros::VoidPtr& tracked = ros::VoidPtr(), const TransportHints& = TransportHints()) {
        return Subscriber(node_.subscribe<sensor_msgs::Image>(topic, queue_size, callback, tracked));
    }
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         void (*callback)(const sensor_msgs::ImageConstPtr&),
                         const TransportHints& = TransportHints()) {
        return Subscriber(node_.subscribe(topic, queue_size, callback));
    }
    template <class Class>
    Subscriber subscribe(const std::string& topic, std::uint32_t queue_size,
                         void (Class::*callback)(const sensor_msgs::ImageConstPtr&), Class* object,
                         const TransportHints& = TransportHints()) {
        return Subscriber(node_.subscribe(topic, queue_size, callback, object));
    }

private:
    ros::NodeHandle node_;
};

}  // namespace image_transport
