// roscpp on the embedded graph: the content of <ros/ros.h> in virtual time.
#pragma once
#include "ros/console.h"
#include "ros/init.h"
#include "ros/names.h"
#include "ros/node_handle.h"
#include "ros/param.h"
#include "ros/publisher.h"
#include "ros/rate.h"
#include "ros/service.h"
#include "ros/subscriber.h"
#include "ros/time.h"
#include "ros/timer.h"
