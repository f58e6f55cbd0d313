#pragma once
#include "ros/message.h"
