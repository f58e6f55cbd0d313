// roscpp on the embedded graph: the content of <ros/ros.h> in virtual time.
#pragma once
// The files that include roscpp's use what these define.
#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <fstream>
#include <list>
#include <set>
#include <sstream>

#include "ros/callback_queue.h"
#include "ros/console.h"
#include "ros/init.h"
#include "ros/names.h"
#include "ros/node_handle.h"
#include "ros/param.h"
#include "ros/publisher.h"
#include "ros/rate.h"
#include "ros/service.h"
#include "ros/spinner.h"
#include "ros/subscriber.h"
#include "ros/time.h"
#include "ros/timer.h"
