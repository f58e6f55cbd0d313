#pragma once
#include "ros/callback_queue.h"
